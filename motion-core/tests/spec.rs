//! The parameter table against `parameters.csv` of the specification, row by row.

use motion_core::parameters::{Decimals, Default, Kind, TABLE};

/// Fields of one CSV line; quotes protect commas.
fn fields(line: &str) -> Vec<String> {
    let mut fields = vec![String::new()];
    let mut quoted = false;
    for c in line.chars() {
        match c {
            '"' => quoted = !quoted,
            ',' if !quoted => fields.push(String::new()),
            c => fields.last_mut().unwrap().push(c),
        }
    }
    fields
}

#[test]
fn the_table_is_the_specifications() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared/spec/parameters.csv");
    let Ok(csv) = std::fs::read_to_string(path) else {
        println!("ignored: needs ../shared/spec/parameters.csv");
        return;
    };
    let mut lines: Vec<Vec<String>> = csv.lines().skip(1).map(fields).collect();
    lines.sort_by_key(|line| line[0].parse::<u16>().unwrap());
    assert_eq!(lines.len(), TABLE.len());
    let plain = |text: &str| text.replace([' ', '?'], "");
    for (row, line) in TABLE.iter().zip(&lines) {
        let [first, last, _, name, _, kind, choices, minimum, maximum, default, unit, decimals, ..] =
            &line[..]
        else {
            panic!("{line:?}")
        };
        assert_eq!((row.first.to_string(), row.last.to_string()), (trim(first), trim(last)));
        // One name is printed a character too long and lost a blank.
        assert_eq!(plain(row.name), plain(name));
        let scale = match &row.kind {
            Kind::Value { minimum: low, maximum: high, unit: has, decimals: digits } => {
                assert_eq!(kind, "value", "[{first}]");
                assert_eq!(has, unit, "[{first}]");
                let scale = match digits {
                    Decimals::Fixed(digits) => {
                        assert_eq!(digits.to_string(), plain(decimals), "[{first}]");
                        10f64.powi(i32::from(*digits))
                    }
                    Decimals::As(index) => {
                        assert_eq!(format!("[{index:03}]"), *decimals, "[{first}]");
                        1.0
                    }
                };
                let value = |text: &str| (plain(text).parse::<f64>().unwrap() * scale).round() as i32;
                assert_eq!((*low, *high), (value(minimum), value(maximum)), "[{first}]");
                scale
            }
            Kind::Choice(texts) => {
                assert_eq!(kind, "characteristic", "[{first}]");
                // [450] prints the choices of outputs 1..3 and 4..6; the table has the first.
                let choices = choices.split(';').next().unwrap().trim_start_matches("1..3: ");
                let listed: Vec<String> = choices.split('|').map(plain).collect();
                let ours: Vec<String> = texts.iter().map(|choice| plain(choice.text)).collect();
                assert_eq!(ours, listed, "[{first}]");
                1.0
            }
        };
        if let (Default::Same(value), Ok(listed)) = (row.default, plain(default).parse::<f64>()) {
            assert_eq!(value, (listed * scale).round() as i32, "[{first}]");
        }
    }
}

fn trim(number: &str) -> String {
    number.parse::<u16>().unwrap().to_string()
}
