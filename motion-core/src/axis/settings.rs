//! Settings of an axis, `[600]`…`[971]`, read from the parameters in one place.

use crate::control::ActualSource;
use crate::io::Terminal;
use crate::parameters::Values;
use crate::trajectory::Limits;

/// Controlling mode, `[600]`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Mode {
    None,
    Control,
    Signals,
    Ramps,
}

/// Auto calibration, `[804]`: the direction in which the reference value is set.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Calibration {
    None,
    Forward,
    Backward,
}

/// Velocities of manual operation, user measuring units/s.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct JogVelocities {
    pub(super) slow: i32,
    pub(super) fast: i32,
}

/// One end of the admissible range.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct End {
    /// `[930]`, `[942]`, if `[924]`, `[936]` are active.
    pub(super) position: Option<i32>,
    /// `[954]`, `[966]` and the level that means "there", if `[948]`, `[960]` are active.
    pub(super) switch: Option<(Terminal, bool)>,
}

impl End {
    /// Whether the hardware limit switch is reached.
    pub(super) fn switched(&self, digital: crate::io::DigitalInputs) -> bool {
        self.switch.is_some_and(|(terminal, level)| digital.get(terminal) == level)
    }
}

/// The fast/slow jog control, 6.8.1.2. Distances in user measuring units, times in ms.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Jogs {
    /// `[816]`.
    pub(super) acceleration: i32,
    /// `[822]`, `[834]`: forward, backward.
    pub(super) shut_down: [i32; 2],
    /// `[828]`, `[840]`.
    pub(super) run_out: [i32; 2],
    /// `[846]`.
    pub(super) shut_down_time: u16,
    /// `[852]`.
    pub(super) acceleration_time: u16,
    /// `[870]`.
    pub(super) run_out_time: u16,
    /// `[858]`: fast in manual operation.
    pub(super) fast_jog: bool,
    /// `[864]`: fast while positioning.
    pub(super) fast_position: bool,
}

/// What an axis is set to.
#[derive(Debug, Clone, Copy)]
pub(super) struct Settings {
    pub(super) mode: Mode,
    /// `[606]`.
    pub(super) source: ActualSource,
    /// `[642]`, user measuring units/s.
    pub(super) maximum: f64,
    /// `[684]`, or V max. where it is 0.
    pub(super) working: f64,
    /// `[648]`, 1/s.
    pub(super) ksp: f64,
    /// `[666]`, `[678]`, `[690]`; `None` until V max. and t max. acceleration are set.
    pub(super) limits: Option<Limits>,
    /// `[654]`, `[660]`: the absolute limits, for stops.
    pub(super) hardest: Option<Limits>,
    /// `[696]`, `[702]`; 0 = off.
    pub(super) following_error: [i32; 2],
    /// `[708]`, `[714]`: below and above the nominal position.
    pub(super) tolerance: [i32; 2],
    /// `[720]`.
    pub(super) tool: i32,
    /// `[732]`.
    pub(super) control_in_stop: bool,
    /// `[738]`.
    pub(super) control_in_position: bool,
    /// `[744]`, ms.
    pub(super) brake_open: u16,
    /// `[750]`, ms.
    pub(super) brake_close: u16,
    /// `[756]`…`[774]`: forward, backward.
    pub(super) jog: [JogVelocities; 2],
    /// `[780]`: keys swapped.
    pub(super) jog_swapped: bool,
    /// `[786]`.
    pub(super) control_jog: bool,
    /// `[792]`.
    pub(super) calibration_fast: i32,
    /// `[798]`.
    pub(super) calibration_slow: i32,
    /// `[804]`.
    pub(super) calibration: Calibration,
    /// `[810]`.
    pub(super) control_calibration: bool,
    /// `[816]`…`[870]`.
    pub(super) jogs: Jogs,
    /// `[900]`/`[912]`, `[906]`/`[918]`, `[894]`/`[642]`: distance and velocity of the ramp points.
    pub(super) ramp: [(i32, i32); 3],
    /// Upper and lower end.
    pub(super) ends: [End; 2],
}

impl Settings {
    pub(super) fn read(values: &Values, at: usize) -> Self {
        let value = |first: u16| values.at(first, at);
        let number = |first: u16| f64::from(value(first));
        let millis = |first: u16| u16::try_from(value(first)).unwrap_or(0);
        let yes = |first: u16| value(first) == 1;
        let maximum = number(642);
        let jog = |slow, fast| JogVelocities { slow: value(slow), fast: value(fast) };
        let end = |switch: u16, position: u16, hardware: u16, terminal: u16| End {
            position: yes(switch).then(|| value(position)),
            switch: match value(hardware) {
                1 => Terminal::from_choice(value(terminal)).map(|terminal| (terminal, false)),
                2 => Terminal::from_choice(value(terminal)).map(|terminal| (terminal, true)),
                _ => None,
            },
        };
        let (limits, hardest) = limits(maximum, [654, 660, 666, 678, 690].map(number));
        Self {
            mode: match value(600) {
                1 => Mode::Control,
                2 => Mode::Signals,
                3 => Mode::Ramps,
                _ => Mode::None,
            },
            source: ActualSource::from_choice(value(606)),
            maximum,
            working: if value(684) > 0 { number(684).min(maximum) } else { maximum },
            ksp: number(648) / 10.0,
            limits,
            hardest,
            following_error: [value(696), value(702)],
            tolerance: [value(708), value(714)],
            tool: value(720),
            control_in_stop: yes(732),
            control_in_position: yes(738),
            brake_open: millis(744).saturating_mul(10),
            brake_close: millis(750).saturating_mul(10),
            jog: [jog(756, 762), jog(768, 774)],
            jog_swapped: yes(780),
            control_jog: yes(786),
            calibration_fast: value(792),
            calibration_slow: value(798),
            calibration: match value(804) {
                1 => Calibration::Forward,
                2 => Calibration::Backward,
                _ => Calibration::None,
            },
            control_calibration: yes(810),
            jogs: Jogs {
                acceleration: value(816),
                shut_down: [value(822), value(834)],
                run_out: [value(828), value(840)],
                shut_down_time: millis(846),
                acceleration_time: millis(852),
                run_out_time: millis(870),
                fast_jog: yes(858),
                fast_position: yes(864),
            },
            ramp: [(value(900), value(912)), (value(906), value(918)), (value(894), value(642))],
            ends: [end(924, 930, 948, 954), end(936, 942, 960, 966)],
        }
    }
}

/// Working and absolute limits (decision 18): a_max = V max./`[654]`, d_max = V max./`[660]` (0: `[654]`);
/// working ones from `[666]`, `[678]` (0: the absolute ones), never above the absolute ones; jerk
/// a_max/`[690]`, without limit where that is 0. Times in ms.
fn limits(maximum: f64, times: [f64; 5]) -> (Option<Limits>, Option<Limits>) {
    let [acceleration, deceleration, working_acceleration, working_deceleration, jerk] = times;
    if acceleration <= 0.0 {
        return (None, None);
    }
    let or = |time: f64, other: f64| if time > 0.0 { time } else { other };
    let deceleration = or(deceleration, acceleration);
    let rate = |time: f64| maximum * 1000.0 / time;
    let jerk = if jerk > 0.0 { rate(acceleration) * 1000.0 / jerk } else { f64::INFINITY };
    let of = |a: f64, d: f64| Limits::new(maximum, rate(a), rate(d), jerk).ok();
    let working = of(
        or(working_acceleration, acceleration).max(acceleration),
        or(working_deceleration, deceleration).max(deceleration),
    );
    (working, of(acceleration, deceleration))
}
