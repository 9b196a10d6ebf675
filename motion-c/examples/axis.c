/* An axis with an analog drive and an incremental encoder, both simulated here: enable, home position,
 * move there and back, a following error when the drive sticks; and a virtual axis 2 that is geared to the
 * encoder by -3/7. Ends with 0 if all was as expected. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "motion.h"

enum { V_MAX = 100000, TARGET = 50000 };

struct machine {
    MotionBlock *power, *move, *reset, *slave, *gear;
    bool enable, execute, acknowledge;
    int32_t target;
    MotionBlockOutputs moved, enabled, geared;
    MotionAxisStatus status, follower;
};

static void application(MotionPlc *plc, void *user) {
    struct machine *machine = user;
    machine->enabled = motion_power(machine->power, plc, machine->enable);
    machine->moved = motion_move_absolute(machine->move, plc, machine->execute, machine->target, 0);
    motion_reset(machine->reset, plc, machine->acknowledge);
    motion_read_status(plc, 1, &machine->status);
    bool slave = motion_power(machine->slave, plc, machine->enable).done && machine->enable;
    machine->geared = motion_gear_in(machine->gear, plc, slave, 1, -3, 7);
    motion_read_status(plc, 2, &machine->follower);
    motion_plc_set_digital_output(plc, 3, 4, machine->moved.done);
}

static void expect(bool fact, const char *words) {
    if (!fact) {
        fprintf(stderr, "not as expected: %s\n", words);
        exit(1);
    }
}

/* The drive: 10 V are V_MAX, first order with 5 ms; and the encoder on it. */
struct drive {
    double velocity, position;
    bool stuck;
};

static MotionInputs turn(struct drive *drive, const MotionOutputs *outputs, double seconds) {
    double wanted = drive->stuck ? 0.0 : outputs->analog[0] / 10000.0 * V_MAX;
    drive->velocity += (wanted - drive->velocity) * (1.0 - exp(-seconds / 0.005));
    drive->position += drive->velocity * seconds;
    MotionInputs inputs = {0};
    inputs.digital[2] = 0x80; /* I3.7, PLC Run */
    inputs.encoders[0].count = (int32_t)floor(drive->position);
    return inputs;
}

static void set(MotionController *controller, uint16_t index, int32_t value) {
    expect(motion_controller_write_parameter(controller, index, value) < 0x80, "a parameter is taken");
}

int main(void) {
    expect(motion_controller_new(8232, NULL, 0) == NULL, "there is no GEL 8232");
    MotionController *controller = motion_controller_new(8230, NULL, 0);
    set(controller, 642, V_MAX);
    set(controller, 654, 200);  /* t max. acceleration 0.2 s */
    set(controller, 648, 300);  /* KSP 30/s */
    set(controller, 708, 5);    /* tolerance */
    set(controller, 714, 5);
    set(controller, 696, 5000); /* following error */
    set(controller, 702, 5000);
    set(controller, 607, 8);    /* axis 2 is virtual */
    set(controller, 643, V_MAX);
    set(controller, 655, 200);
    expect(motion_controller_load(controller) == -1, "the loader has no objection");
    expect(motion_controller_save(controller), "the parameters are saved");

    struct machine machine = {.target = TARGET};
    machine.power = motion_block_new(MOTION_BLOCK_KIND_POWER, 1);
    machine.move = motion_block_new(MOTION_BLOCK_KIND_MOVE_ABSOLUTE, 1);
    machine.reset = motion_block_new(MOTION_BLOCK_KIND_RESET, 1);
    machine.slave = motion_block_new(MOTION_BLOCK_KIND_POWER, 2);
    machine.gear = motion_block_new(MOTION_BLOCK_KIND_GEAR_IN, 2);
    expect(motion_move_absolute(machine.power, NULL, true, 1, 0).error, "a wrong block is an error");

    struct drive drive = {0};
    MotionOutputs outputs = {0};
    uint32_t cycle = motion_controller_cycle_time(controller);
    uint64_t now = 0;
    int done = 0;
    for (; now < 10000000; now += cycle * 1000) {
        MotionInputs inputs = turn(&drive, &outputs, cycle / 1000.0);
        expect(motion_controller_cycle(controller, now, &inputs, &outputs, application, &machine), "a cycle");
        machine.enable = now >= 100000;
        machine.execute = now >= 200000 && now < 3000000;
        if (machine.moved.done && done == 0) {
            done = 1;
            printf("%.3f s: at %d\n", now / 1e6, machine.status.position);
            expect(abs(machine.status.position - TARGET) <= 5, "the axis is at the target");
            expect(outputs.digital[2] == 0x10, "Q3.4 says so");
        }
        if (now == 3900000) { /* at rest, both */
            expect(machine.follower.state == MOTION_AXIS_STATE_SYNCHRONIZED_MOTION, "axis 2 is geared");
            expect(machine.geared.in_velocity && machine.geared.busy, "axis 2 is in gear");
            expect(machine.follower.position == (int32_t)floor(-3.0 * machine.status.position / 7.0),
                   "axis 2 is where the encoder puts it");
            printf("%.3f s: axis 2 at %d\n", now / 1e6, machine.follower.position);
        }
        if (now >= 4000000 && done == 1) { /* back, with a drive that sticks */
            machine.target = 0;
            machine.execute = drive.stuck = true;
        }
        if (machine.moved.error && done == 1) {
            done = 2;
            printf("%.3f s: %s (error %u)\n", now / 1e6, motion_error_text(machine.moved.error_id),
                   machine.moved.error_id);
            expect(machine.status.state == MOTION_AXIS_STATE_ERROR_STOP, "the axis has stopped");
        }
        if (done == 2 && now >= 6000000) {
            drive.stuck = false;
            machine.acknowledge = true;
        }
    }
    expect(done == 2, "the move, then the following error");
    expect(machine.status.state == MOTION_AXIS_STATE_STANDSTILL, "the failure is acknowledged");
    MotionFailure failures[4];
    expect(motion_controller_failures(controller, failures, 4) == 1 && failures[0].axis == 1 &&
               (failures[0].number == 5 || failures[0].number == 6),
           "the following error is stored");

    size_t len = motion_controller_storage_len();
    uint8_t *storage = malloc(len);
    expect(motion_controller_power_off(controller, storage, len), "switched off");
    controller = motion_controller_new(8230, storage, len);
    expect(motion_controller_read_parameter(controller, 642) == V_MAX, "V max. survives");
    expect(motion_controller_failures(controller, NULL, 0) == 1, "the failure survives");
    motion_controller_free(controller);
    motion_block_free(machine.power);
    motion_block_free(machine.move);
    motion_block_free(machine.reset);
    motion_block_free(machine.slave);
    motion_block_free(machine.gear);
    free(storage);
    puts("as expected");
    return 0;
}
