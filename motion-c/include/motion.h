/* motion: a MotionController and its PLCopen function blocks. Made by cbindgen from motion-c/src. */

#ifndef MOTION_H
#define MOTION_H

#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>

// State of an axis, as PLCopen names them.
typedef enum MotionAxisState {
  // Not enabled.
  MOTION_AXIS_STATE_DISABLED,
  // Enabled, at rest.
  MOTION_AXIS_STATE_STANDSTILL,
  // Moving to a position.
  MOTION_AXIS_STATE_DISCRETE_MOTION,
  // Moving without an end: velocity or jog.
  MOTION_AXIS_STATE_CONTINUOUS_MOTION,
  // Looking for the reference point.
  MOTION_AXIS_STATE_HOMING,
  // Braking on a stop, or held by it.
  MOTION_AXIS_STATE_STOPPING,
  // Stopped by a failure, until reset.
  MOTION_AXIS_STATE_ERROR_STOP,
  // Geared to an actual value input.
  MOTION_AXIS_STATE_SYNCHRONIZED_MOTION,
} MotionAxisState;

// Which block.
typedef enum MotionBlockKind {
  // Enables the drive.
  MOTION_BLOCK_KIND_POWER,
  // Looks for the reference point.
  MOTION_BLOCK_KIND_HOME,
  // To a position.
  MOTION_BLOCK_KIND_MOVE_ABSOLUTE,
  // By a distance.
  MOTION_BLOCK_KIND_MOVE_RELATIVE,
  // With a velocity, without an end.
  MOTION_BLOCK_KIND_MOVE_VELOCITY,
  // By hand.
  MOTION_BLOCK_KIND_JOG,
  // Stops with the greatest deceleration, and holds.
  MOTION_BLOCK_KIND_STOP,
  // Stops with the working deceleration.
  MOTION_BLOCK_KIND_HALT,
  // Acknowledges a failure.
  MOTION_BLOCK_KIND_RESET,
  // Makes the actual position what is given.
  MOTION_BLOCK_KIND_SET_POSITION,
  // Along with an actual value input.
  MOTION_BLOCK_KIND_GEAR_IN,
  // Ends gearing.
  MOTION_BLOCK_KIND_GEAR_OUT,
} MotionBlockKind;

// A function block.
typedef struct MotionBlock MotionBlock;

// A MotionController.
typedef struct MotionController MotionController;

// The controller as the application sees it; valid during one call of the application.
typedef struct MotionPlc MotionPlc;

// Outputs of a block.
typedef struct MotionBlockOutputs {
  // Carried out: at the target, at standstill, enabled, reference found.
  bool done;
  // Begun and not ended.
  bool busy;
  // The axis follows this order.
  bool active;
  // Active, and its velocity is reached, or the axis in gear.
  bool in_velocity;
  // Another order took its place.
  bool command_aborted;
  // Failed.
  bool error;
  // Why; `motion_error_text` has the words.
  uint16_t error_id;
} MotionBlockOutputs;

// A classic CAN frame.
typedef struct MotionCanFrame {
  // 11 or 29 bits.
  uint32_t id;
  // A 29-bit identifier.
  bool extended;
  // A remote frame.
  bool remote;
  // Bytes, 0…8.
  uint8_t len;
  // The first `len` of them count.
  uint8_t data[8];
} MotionCanFrame;

// What an encoder terminal block E1…E3 brings in one cycle.
typedef struct MotionEncoder {
  // Incremental encoder: edges counted so far; wraps. SSI encoder: the word it sent, right-aligned.
  int32_t count;
  // Level of the reference track N.
  bool reference;
  // Whether N rose since the cycle before, at `risen_at`.
  bool risen;
  // Count at the last rising edge of N.
  int32_t risen_at;
  // Whether N fell since the cycle before, at `fallen_at`.
  bool fallen;
  // Count at the last falling edge of N.
  int32_t fallen_at;
  // No usable signal: wire break, or edges that the counter could not follow.
  bool fault;
} MotionEncoder;

// What the terminals bring for one cycle.
typedef struct MotionInputs {
  // I1…I4: bit x of element n is terminal I(n+1).x. I3.7 is PLC Run.
  uint8_t digital[4];
  // Readings of the analog inputs I61, I62, I63 (0…1023) and I54…I57 (0…1564).
  uint16_t analog[7];
  // E1…E3.
  struct MotionEncoder encoders[3];
} MotionInputs;

// A pulse output C.
typedef struct MotionPulse {
  // Millihertz; 0 = off.
  uint32_t frequency;
  // Length of a pulse, ns.
  uint32_t pulse;
} MotionPulse;

// What is on the terminals after a cycle.
typedef struct MotionOutputs {
  // Q1…Q3: bit x of element n is terminal Q(n+1).x, 0…4.
  uint8_t digital[3];
  // Voltage between A+ and A- of Q1…Q3, mV, −10000…10000.
  int16_t analog[3];
  // Pulse outputs C of E1…E3.
  struct MotionPulse pulses[3];
} MotionOutputs;

// The application: called once per cycle with the PLC, valid during the call only, and with `user`.
typedef void (*MotionApplication)(struct MotionPlc *plc, void *user);

// A stored failure.
typedef struct MotionFailure {
  // Axis 1…6; 0 = the controller.
  uint8_t axis;
  // Number of manual A 4.3.4.2.
  uint8_t number;
} MotionFailure;

// What an axis is. Positions in user measuring units, velocities a second.
typedef struct MotionAxisStatus {
  // State.
  enum MotionAxisState state;
  // Actual position.
  int32_t position;
  // Actual velocity.
  int32_t velocity;
  // Nominal position.
  int32_t nominal_position;
  // Nominal velocity.
  double nominal_velocity;
  // Nominal minus actual position.
  int32_t deviation;
  // `actual = nominal`: within the tolerance window of a position reached.
  bool at_target;
  // Whether the velocity of a velocity order is reached, or the axis in gear.
  bool in_velocity;
  // Whether the reference point was found since power-on.
  bool homed;
  // What stopped the axis; 0 = nothing.
  uint16_t error_id;
} MotionAxisStatus;

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

// Makes a block for an axis 1…6; to be given back with `motion_block_free`. `kind` is one of
// `MotionBlockKind`; null for others.
struct MotionBlock *motion_block_new(uint32_t kind, uint8_t axis);

// Gives a block back. Null is allowed.
//
// # Safety
// `block` is null or from `motion_block_new`, and not used afterwards.
void motion_block_free(struct MotionBlock *block);

// Enables the drive of the axis as long as `enable`; done when it is as asked for.
//
// # Safety
// `block` is from `motion_block_new`; `plc` is what the application was called with.
struct MotionBlockOutputs motion_power(struct MotionBlock *block,
                                       struct MotionPlc *plc,
                                       bool enable);

// Looks for the reference point as `[804]` says.
//
// # Safety
// `block` is from `motion_block_new`; `plc` is what the application was called with.
struct MotionBlockOutputs motion_home(struct MotionBlock *block,
                                      struct MotionPlc *plc,
                                      bool execute);

// Positions the axis: user measuring units, and units per second (0 = V Work `[684]`).
//
// # Safety
// `block` is from `motion_block_new`; `plc` is what the application was called with.
struct MotionBlockOutputs motion_move_absolute(struct MotionBlock *block,
                                               struct MotionPlc *plc,
                                               bool execute,
                                               int32_t position,
                                               uint32_t velocity);

// Moves the axis by a distance: user measuring units, and units per second (0 = V Work `[684]`).
//
// # Safety
// `block` is from `motion_block_new`; `plc` is what the application was called with.
struct MotionBlockOutputs motion_move_relative(struct MotionBlock *block,
                                               struct MotionPlc *plc,
                                               bool execute,
                                               int32_t distance,
                                               uint32_t velocity);

// Moves the axis with a velocity, user measuring units per second, backward < 0, until another order; not 0.
// `in_velocity` tells that it is reached. In mode Signals only the direction counts; fast if `[858]`
// allows it.
//
// # Safety
// `block` is from `motion_block_new`; `plc` is what the application was called with.
struct MotionBlockOutputs motion_move_velocity(struct MotionBlock *block,
                                               struct MotionPlc *plc,
                                               bool execute,
                                               int32_t velocity);

// Moves the axis by hand with the velocities of `[756]`…`[774]`, as long as one direction is asked for.
//
// # Safety
// `block` is from `motion_block_new`; `plc` is what the application was called with.
struct MotionBlockOutputs motion_jog(struct MotionBlock *block,
                                     struct MotionPlc *plc,
                                     bool forward,
                                     bool backward,
                                     bool fast);

// Stops the axis with the greatest deceleration, and holds it for other orders as long as `execute`.
//
// # Safety
// `block` is from `motion_block_new`; `plc` is what the application was called with.
struct MotionBlockOutputs motion_stop(struct MotionBlock *block,
                                      struct MotionPlc *plc,
                                      bool execute);

// Brings the axis to standstill with the working deceleration.
//
// # Safety
// `block` is from `motion_block_new`; `plc` is what the application was called with.
struct MotionBlockOutputs motion_halt(struct MotionBlock *block,
                                      struct MotionPlc *plc,
                                      bool execute);

// Acknowledges the failure of the axis; done when it is gone.
//
// # Safety
// `block` is from `motion_block_new`; `plc` is what the application was called with.
struct MotionBlockOutputs motion_reset(struct MotionBlock *block,
                                       struct MotionPlc *plc,
                                       bool execute);

// Makes the actual position what is given, user measuring units; the axis must be at rest.
//
// # Safety
// `block` is from `motion_block_new`; `plc` is what the application was called with.
struct MotionBlockOutputs motion_set_position(struct MotionBlock *block,
                                              struct MotionPlc *plc,
                                              bool execute,
                                              int32_t position);

// Gears the axis to actual value input `master`, 1…6, numerator/denominator of its units (neither is 0; < 0 is
// backward), until another order; only in mode Control, else an error. `in_velocity` tells that it is in gear; a
// failure of the master stops it.
//
// # Safety
// `block` is from `motion_block_new`; `plc` is what the application was called with.
struct MotionBlockOutputs motion_gear_in(struct MotionBlock *block,
                                         struct MotionPlc *plc,
                                         bool execute,
                                         uint8_t master,
                                         int32_t numerator,
                                         uint32_t denominator);

// Ends gearing: the axis goes on with the velocity that it has.
//
// # Safety
// `block` is from `motion_block_new`; `plc` is what the application was called with.
struct MotionBlockOutputs motion_gear_out(struct MotionBlock *block,
                                          struct MotionPlc *plc,
                                          bool execute);

// Gives a frame that came on CAN 1 or 2 at `now` (µs) to the controller. False if there is no such bus
// or the frame is none: a length above 8, an identifier out of range.
//
// # Safety
// `controller` is null or from `motion_controller_new`; `frame` is null or valid.
bool motion_can_receive(struct MotionController *controller,
                        uint8_t number,
                        uint64_t now,
                        const struct MotionCanFrame *frame);

// The next frame to send on CAN 1 or 2; false when there is none.
//
// # Safety
// `controller` is null or from `motion_controller_new`; `frame` is null or valid.
bool motion_can_transmit(struct MotionController *controller,
                         uint8_t number,
                         uint64_t now,
                         struct MotionCanFrame *frame);

// Lets time pass on CAN 1 or 2, to be called once a cycle at least. When it is to be called next (µs);
// `UINT64_MAX` when the bus waits for nothing.
//
// # Safety
// `controller` is null or from `motion_controller_new`.
uint64_t motion_can_timeout(struct MotionController *controller,
                            uint8_t number,
                            uint64_t now);

// Bytes of non-volatile memory that a controller has.
size_t motion_controller_storage_len(void);

// Switches a controller on: `model` is 8230, 8231, 8235 or 8236; `storage` is what
// `motion_controller_power_off` left, or null for a controller as delivered. Null if there is no such
// model or `storage_len` is not `motion_controller_storage_len()`.
//
// # Safety
// `storage` is null or valid for reading `storage_len` bytes.
struct MotionController *motion_controller_new(uint16_t model,
                                               const uint8_t *storage,
                                               size_t storage_len);

// Gives a controller back without keeping anything. Null is allowed.
//
// # Safety
// `controller` is null or from `motion_controller_new`, and not used afterwards.
void motion_controller_free(struct MotionController *controller);

// Switches a controller off: copies its non-volatile memory to `storage` and gives it back. False, and
// the controller is as before, if `storage_len` is not `motion_controller_storage_len()`.
//
// # Safety
// `controller` is null or from `motion_controller_new`, not used after true; `storage` is null or valid
// for writing `storage_len` bytes.
bool motion_controller_power_off(struct MotionController *controller,
                                 uint8_t *storage,
                                 size_t storage_len);

// Writes a parameter in display units, as LB2's 32h. The loader's code: 0 done, 01h…7Fh done with a
// warning, from 80h on refused (Appendix 1 of manual A); FFh for a null controller.
//
// # Safety
// `controller` is null or from `motion_controller_new`.
uint8_t motion_controller_write_parameter(struct MotionController *controller,
                                          uint16_t index,
                                          int32_t value);

// Reads a parameter in display units, as LB2's 30h; 0 for an index that has none.
//
// # Safety
// `controller` is null or from `motion_controller_new`.
int32_t motion_controller_read_parameter(const struct MotionController *controller, uint16_t index);

// Runs the loader, as LB2's 34h: −1 if the parameters written are effective now, otherwise the index of
// the first one that is refused; −2 for a null controller.
//
// # Safety
// `controller` is null or from `motion_controller_new`.
int32_t motion_controller_load(struct MotionController *controller);

// Saves the effective parameters in the non-volatile memory, as LB2's 35h. Whether they are.
//
// # Safety
// `controller` is null or from `motion_controller_new`.
bool motion_controller_save(struct MotionController *controller);

// Length of a control cycle, ms: 1 ms × activated axes (`[000]`); 0 for a null controller.
//
// # Safety
// `controller` is null or from `motion_controller_new`.
uint32_t motion_controller_cycle_time(const struct MotionController *controller);

// One control cycle at `now` (µs since any fixed moment): terminals in, terminals out. `application` is
// called once, with `user`, while PLC Run (I3.7) allows it; it may be null. False for null pointers.
//
// # Safety
// `controller` is null or from `motion_controller_new`; `inputs` and `outputs` are null or valid;
// `application` does not use `controller` itself, and does not keep the PLC.
bool motion_controller_cycle(struct MotionController *controller,
                             uint64_t now,
                             const struct MotionInputs *inputs,
                             struct MotionOutputs *outputs,
                             MotionApplication application,
                             void *user);

// Copies up to `len` stored failures, the oldest first; how many there are.
//
// # Safety
// `controller` is null or from `motion_controller_new`; `failures` is null or valid for writing `len`
// elements.
size_t motion_controller_failures(const struct MotionController *controller,
                                  struct MotionFailure *failures,
                                  size_t len);

// Reads what an axis 1…6 is. An error number, 0 = done.
//
// # Safety
// `plc` is what the application was called with; `status` is null or valid.
uint16_t motion_read_status(struct MotionPlc *plc, uint8_t axis, struct MotionAxisStatus *status);

// Terminal I`block`.`bit`, block 1…4, bit 0…7; false for one that is not there.
//
// # Safety
// `plc` is what the application was called with.
bool motion_plc_digital_input(struct MotionPlc *plc, uint8_t block, uint8_t bit);

// Sets terminal Q`block`.`terminal`, block 1…3, terminal 0…4; others are ignored.
//
// # Safety
// `plc` is what the application was called with.
void motion_plc_set_digital_output(struct MotionPlc *plc,
                                   uint8_t block,
                                   uint8_t terminal,
                                   bool high);

// Average reading of analog channel 0…6 (I61, I62, I63: 0…1023; I54…I57: 0…1564); 0 for others.
//
// # Safety
// `plc` is what the application was called with.
int32_t motion_plc_analog_input(struct MotionPlc *plc,
                                uint8_t channel);

// Position of actual value input 1…6, user measuring units; 0 for others.
//
// # Safety
// `plc` is what the application was called with.
int32_t motion_plc_actual_value(struct MotionPlc *plc, uint8_t input);

// What an error number means, as a static text.
const char *motion_error_text(uint16_t error_id);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* MOTION_H */
