//! Parameters whose type the drive does not tell: what is shown, what is taken, and what `--type` decides.
#![cfg(unix)]

mod common;
#[path = "common/linmot.rs"]
mod linmot_drive;
#[path = "common/troubled.rs"]
mod troubled;

use core::f32::consts::PI;

use common::Bench;
use device_sim::linmot::sg5;
use linmot::code::ParameterType as T;
use linmot::drive::Parameter;
use linmot::upid::{Upid, Usage};
use linmot_drive::{CARRIERS, Linmot};
use troubled::{Happens, Troubled};

#[test]
fn numbers_in_the_upper_half_and_floats_are_what_they_are() {
    let usage = Usage::RAM_READ | Usage::ROM_READ | Usage::ROM_WRITE;
    let like = |upid, kind, minimum, maximum, default| Parameter {
        upid: Upid(upid),
        kind,
        usage,
        minimum,
        maximum,
        default,
    };
    for (_, carrier) in CARRIERS {
        let mut tree = sg5();
        tree.extend([
            like(0x3010, T::U8, 128, 200, 150),
            like(0x3011, T::U16, 40_000, 50_000, 45_000),
            like(0x3012, T::U32, 3_000_000_000, 4_000_000_000, 3_500_000_000),
            like(0x3013, T::FLOAT, (-PI).to_bits(), PI.to_bits(), (-1f32).to_bits()),
            like(0x3014, T::S8, 128, 200, 156),
        ]);
        let bench = Bench::new();
        let can = carrier.contains(&"--can");
        let _drive = Troubled::with(&bench, can, tree, Box::new(|_| Happens::Nothing));
        let linmot = Linmot { bench: &bench, carrier };
        let set = |arguments: &[&str]| linmot.run(&[&["params", "set"], arguments].concat());

        linmot
            .run(&["params", "get", "3010h"])
            .ends(0)
            .says("3010h  ROM 150 (00000096h)")
            .says("minimum 128, maximum 200, default 150 (00000096h)")
            .says("or, which --type decides: minimum -128, maximum -56, default -106");
        let json = linmot.json(&["params", "get", "3010h"]);
        let fields = ["rom", "minimum", "maximum", "default"].map(|key| json["parameters"][0][key].as_i64());
        assert_eq!(fields, [150, 128, 200, 150].map(Some));
        set(&["3010h", "--", "160"]).ends(0).says("ROM 160");
        set(&["3010h", "--", "201"])
            .ends(4)
            .says("201 is out of range, 128 to 200, or -128 to -56, expected; nothing was written");
        set(&["3010h", "--type", "u8", "--", "-100"])
            .ends(4)
            .says("-100 is out of range, 128 to 200 expected; nothing was written");
        linmot.run(&["params", "list", "--changed"]).ends(0).says("3010h  ROM 160 (000000A0h)");
        for (upid, number) in [("3011h", "45001"), ("3012h", "3500000001")] {
            set(&[upid, "--", number]).ends(0).says(&format!("{upid}  ROM {number} ("));
            linmot.run(&["params", "get", upid]).ends(0).says(&format!("{upid}  ROM {number} ("));
        }

        linmot
            .run(&["params", "get", "3013h"])
            .ends(0)
            .says("3013h  ROM -1 (BF800000h)")
            .says("minimum -3.1415927, maximum 3.1415927, default -1 (BF800000h)");
        set(&["3013h", "--", "-2.5"]).ends(0).says("3013h  ROM -2.5 (C0200000h)");
        set(&["3013h", "--", "3.2"]).ends(4).says("3.2 is out of range, -3.1415927 to 3.1415927 expected");
        assert_eq!(linmot.json(&["params", "get", "3013h"])["parameters"][0]["rom"].as_f64(), Some(-2.5));

        // A signed one is taken as such, whatever it is shown as.
        set(&["3014h", "--", "-101"]).ends(0).says("ROM 155 (0000009Bh)");
        set(&["3014h", "--type", "i8", "--", "-60"]).ends(0).says("ROM -60 (000000C4h)");
        linmot
            .run(&["params", "get", "3014h", "--type", "i8"])
            .ends(0)
            .says("ROM -60 (000000C4h)")
            .says("minimum -128, maximum -56, default -100");
        set(&["03F2h", "--type", "u8", "--", "x"]).ends(2).says("--type: UPID 03F2h is a string");
        // And what a backup holds is the same bits.
        linmot.run(&["pvl", "backup", "B.pvl"]).ends(0);
        linmot.run(&["--yes", "params", "defaults", "--layer", "application"]).ends(0);
        linmot.run(&["pvl", "compare", "B.pvl"]).ends(1).says("5 differences");
        linmot.run(&["--yes", "pvl", "restore", "B.pvl"]).ends(0).says("5 of them written");
        linmot.run(&["pvl", "compare", "B.pvl"]).ends(0);
    }
}
