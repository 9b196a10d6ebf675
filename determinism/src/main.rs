//! Plays the recording and prints the hashes: on a workstation to its output, on a Cortex-M over
//! semihosting.
#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(target_os = "none")]
mod firmware {
    use cortex_m_rt::entry;
    use cortex_m_semihosting::{debug, hprintln};
    use motion_core::STORAGE_LEN;
    use panic_semihosting as _;

    #[entry]
    fn main() -> ! {
        let (mut storage, mut ram) = ([0xFF; STORAGE_LEN], [0; 65_536]);
        let played = determinism::replay(&mut storage, &mut ram, |cycles, hash| {
            hprintln!("cycle {:5}  {:016x}", cycles, hash);
        });
        match played {
            Ok((counts, hash)) => {
                hprintln!("{:?}\n{:016x}", counts, hash);
                debug::exit(debug::EXIT_SUCCESS);
            }
            Err(error) => {
                hprintln!("the recording is damaged: {:?}", error);
                debug::exit(debug::EXIT_FAILURE);
            }
        }
        loop {}
    }
}

#[cfg(not(target_os = "none"))]
fn main() -> Result<(), Box<dyn std::error::Error>> {
    let (mut storage, mut ram) = (vec![0xFF; motion_core::STORAGE_LEN], vec![0; 65_536]);
    let (counts, hash) = determinism::replay(&mut storage, &mut ram, |cycles, hash| {
        println!("cycle {cycles:5}  {hash:016x}");
    })?;
    println!("{counts:?}\n{hash:016x}");
    if counts.arrived.contains(&0) {
        return Err("an axis does not move: make the recording anew, with \
                    cargo test -p conformance --test determinism -- --ignored"
            .into());
    }
    Ok(())
}
