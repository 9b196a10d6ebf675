//! Reference cases computed by Ruckig 0.17.3, symmetric limits, many with a target velocity.

use motion_core::trajectory::{Limits, Profile, State};
use serde_json::Value;

#[test]
fn durations_are_those_of_ruckig() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared/recorded/trajectories/ruckig-golden.json");
    let Ok(text) = std::fs::read_to_string(path) else {
        println!("ignored: needs ../shared/recorded");
        return;
    };
    let file: Value = serde_json::from_str(&text).unwrap();
    let (mut cases, mut sooner, mut most) = (0, 0, 0.0_f64);
    for case in file["cases"].as_array().unwrap().iter().filter(|case| case["dofs"] == 1) {
        let number = |name: &str| case["input"][name][0].as_f64().unwrap();
        let from = State {
            position: number("current_position"),
            velocity: number("current_velocity"),
            acceleration: number("current_acceleration"),
        };
        let a = number("max_acceleration");
        let limits = Limits::new(number("max_velocity"), a, a, number("max_jerk")).unwrap();
        assert_eq!(number("target_acceleration"), 0.0);
        let mut profile = Profile::at_rest(0.0);
        profile.pass(&from, &limits, number("target_position"), number("target_velocity")).unwrap();
        let duration = case["duration"].as_f64().unwrap();
        let off = profile.duration() / duration - 1.0;
        let rest = from.velocity + from.acceleration * from.acceleration.abs() / (2.0 * limits.jerk());
        if rest.abs().max(from.velocity.abs()) > limits.velocity() && off < -1e-9 {
            // Ruckig comes back below the highest velocity before it plans, which can cost time.
            println!("{}: starts too fast, {:.3} of Ruckig's duration", case["id"], 1.0 + off);
            sooner += 1;
            continue;
        }
        assert!(off.abs() <= 1e-9, "{}: {} s, expected {duration} s", case["id"], profile.duration());
        most = most.max(off.abs());
        for sample in case["samples"].as_array().unwrap() {
            let number = |name: &str| match &sample[name] {
                Value::Array(values) => values[0].as_f64().unwrap(),
                value => value.as_f64().unwrap(),
            };
            let state = profile.at(number("t"));
            assert!((state.position - number("p")).abs() < 1e-8, "{}: {sample}", case["id"]);
            assert!((state.velocity - number("v")).abs() < 1e-7, "{}: {sample}", case["id"]);
        }
        cases += 1;
    }
    println!("{cases} cases the same, {sooner} sooner; at most {most:.1e} off");
    assert_eq!((cases, sooner), (148, 3));
}
