//! The header is what the code says, and a C program links and runs.

use std::path::{Path, PathBuf};
use std::process::Command;

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// With `MOTION_C_HEADER=write` in the environment it is written anew.
#[test]
fn the_header_is_current() {
    let config = cbindgen::Config::from_file(root().join("cbindgen.toml")).unwrap();
    let mut made = Vec::new();
    cbindgen::Builder::new()
        .with_config(config)
        .with_src(root().join("src/lib.rs"))
        .generate()
        .unwrap()
        .write(&mut made);
    let path = root().join("include/motion.h");
    if std::env::var_os("MOTION_C_HEADER").is_some() {
        std::fs::write(&path, &made).unwrap();
    }
    let committed = std::fs::read(&path).unwrap();
    assert_eq!(
        String::from_utf8_lossy(&made),
        String::from_utf8_lossy(&committed),
        "run this test with MOTION_C_HEADER=write"
    );
}

/// The library is where this test is, or a directory above.
fn library() -> PathBuf {
    let test = std::env::current_exe().unwrap();
    let found = test.ancestors().take(4).map(|directory| directory.join("libmotion_c.a"));
    found.into_iter().find(|path| path.exists()).expect("libmotion_c.a beside the tests")
}

#[test]
fn the_c_example_runs() {
    if Command::new("cc").arg("--version").output().is_err() {
        eprintln!("ignored: needs a C compiler");
        return;
    }
    let directory = tempfile::tempdir().unwrap();
    let program = directory.path().join("axis");
    let compiled = Command::new("cc")
        .args(["-std=c11", "-Wall", "-Wextra", "-Werror", "-I"])
        .arg(root().join("include"))
        .arg(root().join("examples/axis.c"))
        .arg(library())
        .args(["-lm", "-lpthread", "-ldl", "-o"])
        .arg(&program)
        .output()
        .unwrap();
    assert!(compiled.status.success(), "{}", String::from_utf8_lossy(&compiled.stderr));
    let ran = Command::new(&program).output().unwrap();
    let said = String::from_utf8_lossy(&ran.stdout);
    assert!(ran.status.success(), "{said}{}", String::from_utf8_lossy(&ran.stderr));
    assert!(said.ends_with("as expected\n"), "{said}");
}
