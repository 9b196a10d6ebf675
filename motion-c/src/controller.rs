//! The controller itself: from power-on to power-off, parameters, and the control cycle.

use core::ffi::c_void;
use core::time::Duration;
use core::{ptr, slice};

use lb2::device::Device;
use lb2::telegram::BANK_LEN;
use motion_core::application;
use motion_core::input;
use motion_core::io::{self, DigitalInputs};
use motion_core::{Model, STORAGE_LEN};

use crate::plc::Plc;

/// A MotionController.
#[derive(Debug)]
pub struct Controller(pub(crate) motion_core::Controller<Vec<u8>, Vec<u8>>);

/// What an encoder terminal block E1…E3 brings in one cycle.
#[derive(Debug, Clone, Copy, Default)]
#[repr(C)]
pub struct Encoder {
    /// Incremental encoder: edges counted so far; wraps. SSI encoder: the word it sent, right-aligned.
    pub count: i32,
    /// Level of the reference track N.
    pub reference: bool,
    /// Whether N rose since the cycle before, at `risen_at`.
    pub risen: bool,
    /// Count at the last rising edge of N.
    pub risen_at: i32,
    /// Whether N fell since the cycle before, at `fallen_at`.
    pub fallen: bool,
    /// Count at the last falling edge of N.
    pub fallen_at: i32,
    /// No usable signal: wire break, or edges that the counter could not follow.
    pub fault: bool,
}

/// What the terminals bring for one cycle.
#[derive(Debug, Clone, Copy, Default)]
#[repr(C)]
pub struct Inputs {
    /// I1…I4: bit x of element n is terminal I(n+1).x. I3.7 is PLC Run.
    pub digital: [u8; 4],
    /// Readings of the analog inputs I61, I62, I63 (0…1023) and I54…I57 (0…1564).
    pub analog: [u16; 7],
    /// E1…E3.
    pub encoders: [Encoder; 3],
}

/// A pulse output C.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
#[repr(C)]
pub struct Pulse {
    /// Millihertz; 0 = off.
    pub frequency: u32,
    /// Length of a pulse, ns.
    pub pulse: u32,
}

/// What is on the terminals after a cycle.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
#[repr(C)]
pub struct Outputs {
    /// Q1…Q3: bit x of element n is terminal Q(n+1).x, 0…4.
    pub digital: [u8; 3],
    /// Voltage between A+ and A- of Q1…Q3, mV, −10000…10000.
    pub analog: [i16; 3],
    /// Pulse outputs C of E1…E3.
    pub pulses: [Pulse; 3],
}

/// A stored failure.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
#[repr(C)]
pub struct Failure {
    /// Axis 1…6; 0 = the controller.
    pub axis: u8,
    /// Number of manual A 4.3.4.2.
    pub number: u8,
}

/// The application: called once per cycle with the PLC, valid during the call only, and with `user`.
pub type Application = Option<unsafe extern "C" fn(plc: *mut Plc, user: *mut c_void)>;

/// Bytes of non-volatile memory that a controller has.
#[unsafe(no_mangle)]
pub extern "C" fn motion_controller_storage_len() -> usize {
    STORAGE_LEN
}

/// Switches a controller on: `model` is 8230, 8231, 8235 or 8236; `storage` is what
/// `motion_controller_power_off` left, or null for a controller as delivered. Null if there is no such
/// model or `storage_len` is not `motion_controller_storage_len()`.
///
/// # Safety
/// `storage` is null or valid for reading `storage_len` bytes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn motion_controller_new(
    model: u16,
    storage: *const u8,
    storage_len: usize,
) -> *mut Controller {
    let Some(model) = Model::from_number(model) else { return ptr::null_mut() };
    let memory = if storage.is_null() {
        vec![0xFF; STORAGE_LEN]
    } else if storage_len == STORAGE_LEN {
        // SAFETY: the caller promises that many readable bytes.
        unsafe { slice::from_raw_parts(storage, storage_len) }.to_vec()
    } else {
        return ptr::null_mut();
    };
    let controller = motion_core::Controller::power_on(model, memory, vec![0; BANK_LEN]);
    Box::into_raw(Box::new(Controller(controller)))
}

/// Gives a controller back without keeping anything. Null is allowed.
///
/// # Safety
/// `controller` is null or from `motion_controller_new`, and not used afterwards.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn motion_controller_free(controller: *mut Controller) {
    if !controller.is_null() {
        // SAFETY: made by Box::into_raw, and given back once.
        drop(unsafe { Box::from_raw(controller) });
    }
}

/// Switches a controller off: copies its non-volatile memory to `storage` and gives it back. False, and
/// the controller is as before, if `storage_len` is not `motion_controller_storage_len()`.
///
/// # Safety
/// `controller` is null or from `motion_controller_new`, not used after true; `storage` is null or valid
/// for writing `storage_len` bytes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn motion_controller_power_off(
    controller: *mut Controller,
    storage: *mut u8,
    storage_len: usize,
) -> bool {
    if controller.is_null() || storage.is_null() || storage_len != STORAGE_LEN {
        return false;
    }
    // SAFETY: made by Box::into_raw, and given back once.
    let memory = unsafe { Box::from_raw(controller) }.0.power_off();
    // SAFETY: the caller promises that many writable bytes, which the memory's vector is not part of.
    unsafe { ptr::copy_nonoverlapping(memory.as_ptr(), storage, memory.len().min(storage_len)) };
    true
}

/// Writes a parameter in display units, as LB2's 32h. The loader's code: 0 done, 01h…7Fh done with a
/// warning, from 80h on refused (Appendix 1 of manual A); FFh for a null controller.
///
/// # Safety
/// `controller` is null or from `motion_controller_new`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn motion_controller_write_parameter(
    controller: *mut Controller,
    index: u16,
    value: i32,
) -> u8 {
    // SAFETY: null or valid, by the caller's promise.
    let Some(controller) = (unsafe { controller.as_mut() }) else { return 0xFF };
    controller.0.write_parameter(index, value).code.0
}

/// Reads a parameter in display units, as LB2's 30h; 0 for an index that has none.
///
/// # Safety
/// `controller` is null or from `motion_controller_new`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn motion_controller_read_parameter(controller: *const Controller, index: u16) -> i32 {
    // SAFETY: null or valid, by the caller's promise.
    unsafe { controller.as_ref() }.map_or(0, |controller| controller.0.read_parameter(index))
}

/// Runs the loader, as LB2's 34h: −1 if the parameters written are effective now, otherwise the index of
/// the first one that is refused; −2 for a null controller.
///
/// # Safety
/// `controller` is null or from `motion_controller_new`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn motion_controller_load(controller: *mut Controller) -> i32 {
    // SAFETY: null or valid, by the caller's promise.
    unsafe { controller.as_mut() }.map_or(-2, |controller| controller.0.call_loader())
}

/// Saves the effective parameters in the non-volatile memory, as LB2's 35h. Whether they are.
///
/// # Safety
/// `controller` is null or from `motion_controller_new`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn motion_controller_save(controller: *mut Controller) -> bool {
    // SAFETY: null or valid, by the caller's promise.
    unsafe { controller.as_mut() }.is_some_and(|controller| controller.0.save_parameters().is_ok())
}

/// Length of a control cycle, ms: 1 ms × activated axes (`[000]`); 0 for a null controller.
///
/// # Safety
/// `controller` is null or from `motion_controller_new`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn motion_controller_cycle_time(controller: *const Controller) -> u32 {
    // SAFETY: null or valid, by the caller's promise.
    unsafe { controller.as_ref() }.map_or(0, |controller| controller.0.cycle_time().as_millis() as u32)
}

/// One control cycle at `now` (µs since any fixed moment): terminals in, terminals out. `application` is
/// called once, with `user`, while PLC Run (I3.7) allows it; it may be null. False for null pointers.
///
/// # Safety
/// `controller` is null or from `motion_controller_new`; `inputs` and `outputs` are null or valid;
/// `application` does not use `controller` itself, and does not keep the PLC.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn motion_controller_cycle(
    controller: *mut Controller,
    now: u64,
    inputs: *const Inputs,
    outputs: *mut Outputs,
    application: Application,
    user: *mut c_void,
) -> bool {
    // SAFETY: each null or valid, by the caller's promise.
    let (Some(controller), Some(inputs), Some(outputs)) =
        (unsafe { (controller.as_mut(), inputs.as_ref(), outputs.as_mut()) })
    else {
        return false;
    };
    let mut call = |plc: &mut application::Plc<'_>| {
        if let Some(application) = application {
            // SAFETY: the caller's own function; the PLC outlives the call.
            unsafe { application(ptr::from_mut(plc).cast(), user) };
        }
    };
    let put = controller.0.cycle(Duration::from_micros(now), &inputs.read(), &mut call);
    *outputs = Outputs {
        digital: put.digital,
        analog: put.analog,
        pulses: put.pwm.map(|pwm| Pulse { frequency: pwm.frequency(), pulse: pwm.pulse() }),
    };
    // Memory does not fail.
    let _ = controller.0.advance(controller.0.cycle_time());
    true
}

/// Copies up to `len` stored failures, the oldest first; how many there are.
///
/// # Safety
/// `controller` is null or from `motion_controller_new`; `failures` is null or valid for writing `len`
/// elements.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn motion_controller_failures(
    controller: *const Controller,
    failures: *mut Failure,
    len: usize,
) -> usize {
    // SAFETY: null or valid, by the caller's promise.
    let Some(controller) = (unsafe { controller.as_ref() }) else { return 0 };
    let stored = controller.0.failures().stored();
    if !failures.is_null() {
        for (at, stored) in stored.iter().take(len).enumerate() {
            let failure = Failure { axis: stored.axis, number: stored.failure.0 };
            // SAFETY: `at` is below `len`, and the caller promises so many writable elements.
            unsafe { failures.add(at).write(failure) };
        }
    }
    stored.len()
}

impl Inputs {
    fn read(&self) -> io::Inputs {
        io::Inputs {
            digital: DigitalInputs::new(self.digital),
            analog: self.analog,
            encoders: self.encoders.map(|encoder| input::Encoder {
                count: encoder.count,
                reference: encoder.reference,
                risen: encoder.risen.then_some(encoder.risen_at),
                fallen: encoder.fallen.then_some(encoder.fallen_at),
                fault: encoder.fault,
            }),
        }
    }
}
