//! Every system parameter `[000]`…`[971]` of manual A, chapter 6, one row a parameter, in the order of
//! its numbers (6.10).
//!
//! The manual's bold print, which marks the defaults, is lost: where neither its text nor its other
//! chapters give a default, it is the first choice, or the range's value nearest 0 (decision 25).

use super::row::{
    Choice, Decimals, Decimals::*, Default, Default::*, Family, Family::*, Kind, Row, choice as c,
};

const AXES: &[Choice] =
    &[c("None"), c("1 AX/AI"), c("2 AX/AI"), c("3 AX/AI"), c("4 AX/AI"), c("5 AX/AI"), c("6 AX/AI")];
const LANGUAGES: &[Choice] = &[c("Deutsch"), c("English")];
const INACTIVE_ACTIVE: &[Choice] = &[c("Inactive"), c("Active")];
const YES_NO: &[Choice] = &[c("Yes"), c("No")];
const PLC_STOP: &[Choice] = &[c("No"), c("Control"), c("Regulate")];
const COM: &[Choice] = &[c("COM 1"), c("COM 2")];
const BAUD: &[Choice] = &[c("9600 BD"), c("19200 BD"), c("28800 BD"), c("38400 BD"), c("57600 BD")];
const PARITY: &[Choice] = &[c("None"), c("Odd"), c("Even")];
const STOP_BITS: &[Choice] = &[c("1 Bit"), c("2 Bits")];
const DECIMAL_POINT: &[Choice] = &[c("X."), c("X.X"), c("X.XX"), c("X.XXX"), c("X.XXXX")];
const OFF_ON: &[Choice] = &[c("Off"), c("On")];
const INTEL_MOTOROLA: &[Choice] = &[c("Intel"), c("Motorola")];
const PROFIBUS: &[Choice] = &[
    c("1 Byte"),
    c("2 Byte"),
    c("3 Byte"),
    c("8 Byte"),
    c("16 Byte"),
    c("32 Byte"),
    c("64 Byte"),
    c("128 Byte"),
];
const INPUT_TYPE: &[Choice] =
    &[c("Incremental"), c("SSI absolute"), c("CAN bus"), c("Virtual1"), c("Virtual2"), c("Analog")];
const EDGES: &[Choice] = &[c("Ink_V"), c("Ink_S")];
const SSI_CODE: &[Choice] = &[c("Gray"), c("Binary")];
const SSI_TYPE: &[Choice] = &[c("Single-turn"), c("Multi-turn")];
const SOURCE: &[Choice] =
    &[c("Act. value"), c("Frequency"), c("Position"), c("Velocity"), c("Stepper motor")];
const NO_YES: &[Choice] = &[c("No"), c("Yes")];
const CALIBRATION: &[Choice] = &[c("Inactive"), c("Forward"), c("Backward"), c("For/Back")];
const CALIBRATION_EDGE: &[Choice] = &[c("Inactive"), c("H->L"), c("L->H"), c("H->LL->H")];
const CALIBRATION_INPUT: &[Choice] = &[
    c("None"),
    c("E1.N"),
    c("E2.N"),
    c("E3.N"),
    c("I1.0"),
    c("I1.1"),
    c("I1.2"),
    c("I1.3"),
    c("I1.4"),
    c("I1.5"),
    c("CAN bus"),
];
const OBJECT_IN: &[Choice] =
    &[c("Inactive"), c("CAN1 I1"), c("CAN1 I2"), c("CAN2 I1"), c("CAN2 I2"), c("CAN2 I3"), c("CAN2 I4")];
const LD_2000: &[Choice] = &[c("LD 2000")];
const ANALOG_INPUT: &[Choice] =
    &[c("I/U I61"), c("I/U I62"), c("I/U I63"), c("Temp I54"), c("Temp I55"), c("Temp I56"), c("Temp I57")];
const ANALOG_VALUE: &[Choice] = &[c("Average"), c("Reading")];
const MASTER_SLAVE: &[Choice] = &[c("Master"), c("Slave")];
const OBJECT_TYPE: &[Choice] = &[c("Inactive"), c("Digital"), c("Analogue"), c("Axis"), c("Other")];
const OBJECT_TYPE_CAN_2: &[Choice] = &[c("-"), c("-"), c("-"), c("Axis"), c("-")];
const OUTPUT_TYPE: &[Choice] = &[c("None"), c("Analogue"), c("CAN-Bus"), c("Signals"), c("Stepper m.")];
const DIRECTION: &[Choice] = &[c("+ = Forw."), c("- = Forw.")];
const VOLTAGE_RANGE: &[Choice] = &[c("+/- 10 V"), c("+ 10 V")];
const OBJECT_OUT: &[Choice] =
    &[c("Inactive"), c("CAN1 O1"), c("CAN1 O2"), c("CAN2 O1"), c("CAN2 O2"), c("CAN2 O3"), c("CAN2 O4")];
const SIGNAL_OUTPUT: &[Choice] = &[c("None"), c("Slow x.3"), c("S/F .3/4")];
const DIRECTION_OUTPUT: &[Choice] = &[c("None"), c("forw x.2"), c("backw x.2"), c("f/b .2/1")];
const CONTROLLING_MODE: &[Choice] = &[c("None"), c("Control."), c("Signals"), c("Ramps")];
const AXIS_INPUT: &[Choice] = &[
    c("None"),
    c("Input 1"),
    c("Input 2"),
    c("Input 3"),
    c("Input 4"),
    c("Input 5"),
    c("Input 6"),
    c("Stepper motor"),
    c("Virtual"),
];
const AXIS_OUTPUT: &[Choice] =
    &[c("None"), c("Output 1"), c("Output 2"), c("Output 3"), c("Output 4"), c("Output 5"), c("Output 6")];
const JOGGING: &[Choice] = &[c("[>][>>]"), c("[<<][<]")];
const AUTO_CALIBRATION: &[Choice] = &[c("None"), c("Forward"), c("Backward")];
const HW_LIMIT: &[Choice] = &[c("Inactive"), c("Low active"), c("High active")];
const LIMIT_INPUT: &[Choice] = &[
    c("IX 1.0"),
    c("IX 1.1"),
    c("IX 1.2"),
    c("IX 1.3"),
    c("IX 1.4"),
    c("IX 1.5"),
    c("IX 2.0"),
    c("IX 2.1"),
    c("IX 2.2"),
    c("IX 2.3"),
    c("IX 2.4"),
    c("IX 2.5"),
    c("IX 2.6"),
    c("IX 2.7"),
    c("IX 3.0"),
    c("IX 3.1"),
    c("IX 3.2"),
    c("IX 3.3"),
    c("IX 3.4"),
    c("IX 3.5"),
    c("IX 3.6"),
    c("IX 3.7"),
    c("IX 4.0"),
    c("IX 4.1"),
    c("IX 4.2"),
    c("IX 4.3"),
    c("IX 4.4"),
    c("IX 4.5"),
    c("IX 4.6"),
    c("IX 4.7"),
];

/// In user measuring units of an input, output or axis, whose display has its own decimal point.
const UNITS: &str = "user units";
/// User measuring units per second.
const SPEED: &str = "user units/s";

/// The table.
#[rustfmt::skip]
pub static TABLE: [Row; 122] = [
    row(0, 0, Single, "Act. axes/act. in.", "General", choice(AXES), Same(3), "6.3.1"),
    row(1, 1, Single, "Languages", "General", choice(LANGUAGES), Same(0), "6.3.1"),
    row(2, 2, Single, "Service mode", "General", choice(INACTIVE_ACTIVE), Same(0), "6.3.1"),
    row(3, 3, Single, "PLC active", "PLC", choice(YES_NO), Same(0), "6.3.2"),
    row(4, 4, Single, "Stop at PLC stop", "PLC", choice(PLC_STOP), Same(0), "6.3.2"),
    row(5, 5, Single, "Device number", "Serial communication", value(0, 31, "", Fixed(0)), Same(0), "6.3.3"),
    row(6, 6, Single, "CoDeSys interface", "Serial communication", choice(COM), Same(0), "6.3.3"),
    row(7, 8, Com, "Baud rate", "", choice(BAUD), Same(1), "6.3.3.1"),
    row(9, 10, Com, "Parity check", "", choice(PARITY), Same(2), "6.3.3.1"),
    row(11, 12, Com, "Stop bits", "", choice(STOP_BITS), Same(0), "6.3.3.1"),
    row(13, 18, Input, "Display decimal pnt.", "", choice(DECIMAL_POINT), Same(0), "6.6.1"),
    row(19, 19, Single, "ASCII interface", "Serial communication", choice(COM), Same(0), "6.3.3"),
    row(20, 25, Output, "Display decimal pnt.", "", choice(DECIMAL_POINT), Same(0), "6.7.1"),
    row(26, 31, Axis, "Display decimal pnt.", "", choice(DECIMAL_POINT), Same(0), "6.8.1"),
    row(32, 32, Single, "Company logo", "General", choice(OFF_ON), Same(1), "6.3.1"),
    row(35, 41, AnalogInput, "State", "", choice(INACTIVE_ACTIVE), Same(0), "6.4.1"),
    row(42, 48, AnalogInput, "Gate time", "", value(1, 100, "s", Fixed(2)), Same(1), "6.4.1"),
    row(56, 56, Single, "Data format", "", choice(INTEL_MOTOROLA), Same(0), "6.9.1"),
    row(60, 60, Single, "Byte count IN", "DeviceNet", value(0, 512, "byte", Fixed(0)), Same(0), "6.9.1"),
    row(61, 61, Single, "Byte count OUT", "DeviceNet", value(0, 512, "byte", Fixed(0)), Same(0), "6.9.1"),
    row(70, 70, Single, "Byte count IN/OUT", "InterBus-S", value(0, 20, "byte", Fixed(0)), Same(0), "6.9.2"),
    row(80, 80, Single, "Byte count IN", "PROFIBUS-DP", choice(PROFIBUS), Same(0), "6.9.3"),
    row(81, 81, Single, "Byte count OUT", "PROFIBUS-DP", choice(PROFIBUS), Same(0), "6.9.3"),
    row(100, 105, Input, "Type", "", choice(INPUT_TYPE), Each(&[0, 0, 0, 2, 2, 2]), "6.6.1"),
    row(107, 112, Input, "State", "", choice(INACTIVE_ACTIVE), Each(&[1, 1, 1, 0, 0, 0]), "6.6.1"),
    row(128, 130, Input, "Signal evaluation", "Incremental", choice(EDGES), Same(0), "6.6.1.1"),
    row(135, 137, Input, "SSI code", "SSI absolute", choice(SSI_CODE), Same(0), "6.6.1.2"),
    row(142, 144, Input, "SSI- Type", "SSI absolute", choice(SSI_TYPE), Same(0), "6.6.1.2"),
    row(149, 151, Input, "Single-turn bits", "SSI absolute", value(0, 13, "bit", Fixed(0)), Same(12), "6.6.1.2"),
    row(156, 161, Input, "Type of source", "Virtual2", choice(SOURCE), Same(0), "6.6.1.5"),
    row(163, 168, Input, "Number of the source", "Virtual2", value(1, 6, "", Fixed(0)), Each(&[1, 2, 3, 4, 5, 6]), "6.6.1.5"),
    row(170, 175, Input, "Counter frequency", "Virtual1", value(-99999999, 99999999, "increments/s", Fixed(0)), Same(0), "6.6.1.4"),
    row(184, 189, Input, "Failure diff. MAX", "", value(0, 99999999, UNITS, As(13)), Same(0), "6.6.1"),
    row(191, 196, Input, "Failure tolerance", "", value(0, 3, "cycles", Fixed(0)), Same(0), "6.6.1"),
    row(198, 203, Input, "Negation", "Incremental (all types)", choice(NO_YES), Same(0), "6.6.1.1"),
    row(205, 210, Input, "Multiplier numerator", "Incremental (all types)", value(0, 16777215, "", Fixed(0)), Same(10000), "6.6.1.1"),
    row(212, 217, Input, "Multipl. denominator", "Incremental (all types)", value(0, 16777215, "", Fixed(0)), Same(10000), "6.6.1.1"),
    row(219, 224, Input, "Home offset adjustm.", "Incremental (all types)", value(-99999999, 99999999, UNITS, As(13)), Same(0), "6.6.1.1"),
    row(226, 231, Input, "Calibration", "Incremental (all types)", choice(CALIBRATION), Same(0), "6.6.1.1"),
    row(233, 238, Input, "Calibration edge", "Incremental (all types)", choice(CALIBRATION_EDGE), Same(0), "6.6.1.1"),
    row(240, 245, Input, "Calibration input", "Incremental (all types)", choice(CALIBRATION_INPUT), Each(&[1, 2, 3, 10, 10, 10]), "6.6.1.1"),
    row(247, 252, Input, "Calibration value", "Incremental (all types)", value(-99999999, 99999999, UNITS, As(13)), Same(0), "6.6.1.1"),
    row(254, 259, Input, "Object/PDO IN", "CAN bus", choice(OBJECT_IN), Each(&[3, 4, 5, 6, 1, 2]), "6.6.1.3"),
    row(261, 266, Input, "CAN bus source", "CAN bus", choice(LD_2000), Same(0), "6.6.1.3"),
    row(268, 273, Input, "Analog input", "Analog", choice(ANALOG_INPUT), Each(&[0, 1, 2, 3, 4, 5]), "6.6.1.6"),
    row(275, 280, Input, "Type of analog value", "Analog", choice(ANALOG_VALUE), Same(0), "6.6.1.6"),
    row(300, 301, Can, "Type", "", choice(MASTER_SLAVE), Same(0), "6.5.1"),
    row(302, 303, Can, "CAN Link", "", choice(NO_YES), Same(0), "6.5.1"),
    row(310, 317, Can1Object, "Node address", "", value(0, 127, "", Fixed(0)), Each(&[1, 2, 3, 4, 1, 2, 3, 4]), "6.5.1.1"),
    row(326, 333, Can1Object, "Object type", "", choice(OBJECT_TYPE), Same(0), "6.5.1.1"),
    row(334, 341, Can1Object, "Master bypass", "", choice(NO_YES), Same(0), "6.5.1.1"),
    row(342, 349, Can2Object, "Node address", "", value(0, 127, "", Fixed(0)), Each(&[1, 2, 3, 4, 1, 2, 3, 4]), "6.5.1.1"),
    row(358, 365, Can2Object, "Object type", "", choice(OBJECT_TYPE_CAN_2), Same(3), "6.5.1.1"),
    row(366, 373, Can2Object, "Master bypass", "", choice(NO_YES), Same(0), "6.5.1.1"),
    row(450, 455, Output, "Type", "", choice(OUTPUT_TYPE), Each(&[1, 1, 1, 0, 0, 0]), "6.7.1"),
    row(468, 470, Output, "Direction", "Analog, CAN bus", choice(DIRECTION), Same(0), "6.7.1.1, 6.7.1.2"),
    row(474, 476, Output, "Voltage range", "Analog", choice(VOLTAGE_RANGE), Same(0), "6.7.1.1"),
    row(480, 482, Output, "U max.", "Analog", value(0, 10000, "V", Fixed(3)), Same(10000), "6.7.1.1"),
    row(486, 491, Output, "Object/PDO OUT", "CAN bus", choice(OBJECT_OUT), Each(&[3, 4, 5, 6, 1, 2]), "6.7.1.2"),
    row(492, 497, Output, "CAN bus dest.", "CAN bus", choice(LD_2000), Same(0), "6.7.1.2"),
    row(498, 503, Output, "Inc. / rounding", "CAN bus", value(0, 99999999, "increments/rev", Fixed(0)), Same(65536), "6.7.1.2"),
    row(504, 506, Output, "U min. +", "Analog", value(0, 10000, "V", Fixed(3)), Same(0), "6.7.1.1"),
    row(510, 512, Output, "U min. -", "Analog", value(0, 10000, "V", Fixed(3)), Same(0), "6.7.1.1"),
    row(516, 518, Output, "Dead range +", "Analog", value(0, 99999999, UNITS, As(20)), Same(0), "6.7.1.1"),
    row(522, 524, Output, "Dead range -", "Analog", value(0, 99999999, UNITS, As(20)), Same(0), "6.7.1.1"),
    row(528, 530, Output, "Signal output to Qx", "Signals", choice(SIGNAL_OUTPUT), Same(0), "6.7.1.3"),
    row(534, 536, Output, "Reverse direction", "Signals, Stepper motor", choice(NO_YES), Same(0), "6.7.1.3"),
    row(540, 542, Output, "max. stepping frequ.", "Stepper motor", value(0, 100000, "Hz", Fixed(0)), Same(0), "6.7.1.4"),
    row(546, 548, Output, "Direction on Qx", "Analog, Signals, Stepper motor", choice(DIRECTION_OUTPUT), Same(0), "6.7.1.1, 6.7.1.3"),
    row(600, 605, Axis, "Controlling mode", "", choice(CONTROLLING_MODE), Each(&[1, 1, 1, 0, 0, 0]), "6.8.1"),
    row(606, 611, Axis, "Actual value input", "", choice(AXIS_INPUT), Each(&[1, 2, 3, 4, 5, 6]), "6.8.1"),
    row(612, 617, Axis, "Nominal value output", "", choice(AXIS_OUTPUT), Each(&[1, 2, 3, 4, 5, 6]), "6.8.1"),
    row(642, 647, Axis, "V max.", "Feedback control, Ramps", value(0, 3276800, SPEED, As(26)), Same(0), "6.8.1.1"),
    row(648, 653, Axis, "KSP", "Feedback control, Ramps", value(0, 9999, "1/s", Fixed(1)), Same(0), "6.8.1.1"),
    row(654, 659, Axis, "t max. acceleration", "Feedback control, Ramps", value(0, 9999, "s", Fixed(3)), Same(0), "6.8.1.1"),
    row(660, 665, Axis, "t max. deceleration", "Feedback control, Ramps", value(0, 9999, "s", Fixed(3)), Same(0), "6.8.1.1"),
    row(666, 671, Axis, "t acceleration", "Feedback control, Ramps", value(0, 9999, "s", Fixed(3)), Same(0), "6.8.1.1"),
    row(678, 683, Axis, "t deceleration", "Feedback control, Ramps", value(0, 9999, "s", Fixed(3)), Same(0), "6.8.1.1"),
    row(684, 689, Axis, "V Work", "Feedback control, Ramps", value(0, 3276800, SPEED, As(26)), Same(0), "6.8.1.1"),
    row(690, 695, Axis, "T jerking", "Feedback control, Ramps", value(0, 9999, "s", Fixed(3)), Same(0), "6.8.1.1"),

    // Printed "Max. contour. error +", one character longer than a name can be.
    row(696, 701, Axis, "Max. contour.error +", "Feedback control, Ramps", value(0, 99999999, UNITS, As(26)), Same(0), "6.8.1.1"),
    row(702, 707, Axis, "Max. contour.error -", "Feedback control, Ramps", value(0, 99999999, UNITS, As(26)), Same(0), "6.8.1.1"),
    row(708, 713, Axis, "Tolerance +", "Feedback control, Ramps, Signals", value(0, 99999999, UNITS, As(26)), Same(0), "6.8.1.1, 6.8.1.2"),
    row(714, 719, Axis, "Tolerance -", "Feedback control, Ramps, Signals", value(0, 99999999, UNITS, As(26)), Same(0), "6.8.1.1, 6.8.1.2"),
    row(720, 725, Axis, "Tool correction", "Feedback control, Ramps", value(-99999999, 99999999, UNITS, As(26)), Same(0), "6.8.1.1"),
    row(732, 737, Axis, "Control in stop", "Feedback control, Ramps", choice(NO_YES), Same(0), "6.8.1.1"),
    row(738, 743, Axis, "Control in nom. pos.", "Feedback control, Ramps", choice(NO_YES), Same(1), "6.8.1.1"),
    row(744, 749, Axis, "t brake open", "Feedback control, Ramps, Signals", value(0, 999, "s", Fixed(2)), Same(0), "6.8.1.1, 6.8.1.2"),
    row(750, 755, Axis, "t brake close", "Feedback control, Ramps", value(0, 999, "s", Fixed(2)), Same(0), "6.8.1.1"),
    row(756, 761, Axis, "V jog slow forward", "Feedback control, Ramps", value(0, 3276800, SPEED, As(26)), Same(0), "6.8.1.1"),
    row(762, 767, Axis, "V jog fast forward", "Feedback control, Ramps", value(0, 3276800, SPEED, As(26)), Same(0), "6.8.1.1"),
    row(768, 773, Axis, "V jog slow backward", "Feedback control, Ramps", value(0, 3276800, SPEED, As(26)), Same(0), "6.8.1.1"),
    row(774, 779, Axis, "V jog fast backward", "Feedback control, Ramps", value(0, 3276800, SPEED, As(26)), Same(0), "6.8.1.1"),
    row(780, 785, Axis, "Jogging forward", "Feedback control, Ramps, Signals", choice(JOGGING), Same(0), "6.8.1.1, 6.8.1.2"),
    row(786, 791, Axis, "Control jog", "Feedback control, Ramps", choice(NO_YES), Same(0), "6.8.1.1"),
    row(792, 797, Axis, "Auto calibration V1", "Feedback control, Ramps", value(0, 3276800, SPEED, As(26)), Same(0), "6.8.1.1"),
    row(798, 803, Axis, "Auto calibration V2", "Feedback control, Ramps", value(0, 3276800, SPEED, As(26)), Same(0), "6.8.1.1"),
    row(804, 809, Axis, "Auto calibration", "Feedback control, Ramps, Signals", choice(AUTO_CALIBRATION), Same(0), "6.8.1.1, 6.8.1.2"),
    row(810, 815, Axis, "Control calibration", "Feedback control, Ramps", choice(NO_YES), Same(0), "6.8.1.1"),
    row(816, 821, Axis, "ds acceleration", "Signals", value(0, 99999999, UNITS, As(26)), Same(0), "6.8.1.2"),
    row(822, 827, Axis, "ds shut down +", "Signals", value(0, 99999999, UNITS, As(26)), Same(0), "6.8.1.2"),
    row(828, 833, Axis, "ds run out +", "Signals", value(0, 99999999, UNITS, As(26)), Same(0), "6.8.1.2"),
    row(834, 839, Axis, "ds shut down -", "Signals", value(0, 99999999, UNITS, As(26)), Same(0), "6.8.1.2"),
    row(840, 845, Axis, "ds run out -", "Signals", value(0, 99999999, UNITS, As(26)), Same(0), "6.8.1.2"),
    row(846, 851, Axis, "dt shut down", "Signals", value(0, 9999, "s", Fixed(3)), Same(0), "6.8.1.2"),
    row(852, 857, Axis, "dt acceleration", "Signals", value(0, 9999, "s", Fixed(3)), Same(0), "6.8.1.2"),
    row(858, 863, Axis, "Fast jog", "Signals", choice(NO_YES), Same(0), "6.8.1.2"),
    row(864, 869, Axis, "Fast pos.", "Signals", choice(NO_YES), Same(0), "6.8.1.2"),
    row(870, 875, Axis, "dt run out", "Signals", value(0, 9999, "s", Fixed(3)), Same(0), "6.8.1.2"),
    row(894, 899, Axis, "ds Vmax - Ramp", "Ramps", value(0, 99999999, UNITS, As(26)), Same(0), "6.8.1.3"),
    row(900, 905, Axis, "ds V1 - Ramp", "Ramps", value(0, 99999999, UNITS, As(26)), Same(0), "6.8.1.3"),
    row(906, 911, Axis, "ds V2 - Ramp", "Ramps", value(0, 99999999, UNITS, As(26)), Same(0), "6.8.1.3"),
    row(912, 917, Axis, "V1 - Ramp", "Ramps", value(0, 3276800, SPEED, As(26)), Same(0), "6.8.1.3"),
    row(918, 923, Axis, "V2 - Ramp", "Ramps", value(0, 3276800, SPEED, As(26)), Same(0), "6.8.1.3"),
    row(924, 929, Axis, "SW limit switch +", "Feedback control", choice(INACTIVE_ACTIVE), Same(0), "6.8.1.1"),
    row(930, 935, Axis, "SW limit position +", "Feedback control", value(-99999999, 99999999, UNITS, As(26)), Same(0), "6.8.1.1"),
    row(936, 941, Axis, "SW limit switch -", "Feedback control", choice(INACTIVE_ACTIVE), Same(0), "6.8.1.1"),
    row(942, 947, Axis, "SW limit position -", "Feedback control", value(-99999999, 99999999, UNITS, As(26)), Same(0), "6.8.1.1"),
    row(948, 953, Axis, "HW limit switch +", "Feedback control", choice(HW_LIMIT), Same(0), "6.8.1.1"),
    row(954, 959, Axis, "HW limit switch in +", "Feedback control", choice(LIMIT_INPUT), Same(0), "6.8.1.1"),
    row(960, 965, Axis, "HW limit switch -", "Feedback control", choice(HW_LIMIT), Same(0), "6.8.1.1"),
    row(966, 971, Axis, "HW limit switch in -", "Feedback control", choice(LIMIT_INPUT), Same(0), "6.8.1.1"),
];

#[allow(clippy::too_many_arguments, reason = "one line a parameter reads best")]
const fn row(
    first: u16,
    last: u16,
    family: Family,
    name: &'static str,
    page: &'static str,
    kind: Kind,
    default: Default,
    clause: &'static str,
) -> Row {
    Row { first, last, family, name, page, kind, default, clause }
}

const fn value(minimum: i32, maximum: i32, unit: &'static str, decimals: Decimals) -> Kind {
    Kind::Value { minimum, maximum, unit, decimals }
}

const fn choice(choices: &'static [Choice]) -> Kind {
    Kind::Choice(choices)
}
