//! A slow solver that shares nothing with the crate but the rules: it plays the two-stage policy "push
//! greedily towards the highest velocity for some time, then go greedily to the final velocity" event by
//! event in the axis's own units, and bisects the time of the push.

use motion_core::trajectory::{Limits, State};

/// Result of a play: where it ends, and when.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Played {
    pub(crate) position: f64,
    pub(crate) time: f64,
}

#[derive(Clone, Copy)]
struct Body {
    p: f64,
    v: f64,
    a: f64,
    t: f64,
}

impl Body {
    fn advance(&mut self, t: f64, j: f64) {
        self.p += t * (self.v + t * (self.a / 2.0 + t * j / 6.0));
        self.v += t * (self.a + t * j / 2.0);
        self.a += t * j;
        self.t += t;
    }
}

/// Least positive root of c + b t + a t² with a ≥ 0, b ≥ 0, c ≤ 0.
fn least(a: f64, b: f64, c: f64) -> f64 {
    if c >= 0.0 {
        return 0.0;
    }
    let root = (b * b - 4.0 * a * c).max(0.0).sqrt();
    if b + root > 0.0 { 2.0 * -c / (b + root) } else { f64::INFINITY }
}

/// Greedily towards velocity `goal`, for at most `limit` seconds; without end for `None`, until `goal`
/// is reached.
fn toward(body: &mut Body, goal: f64, limit: Option<f64>, limits: &Limits) {
    let (grow, fall, jerk) = (limits.acceleration(), limits.deceleration(), limits.jerk());
    let end = limit.map_or(f64::INFINITY, |limit| body.t + limit);
    let small_a = 1e-13 * grow.max(fall);
    let small_v = 1e-14 * (limits.velocity() + body.v.abs() + body.a * body.a / jerk);
    for _ in 0..100 {
        let left = end - body.t;
        if left <= 0.0 {
            return;
        }
        let rest = body.v + body.a * body.a.abs() / (2.0 * jerk);
        if (rest - goal).abs() <= small_v {
            let time = body.a.abs() / jerk;
            if time >= left {
                body.advance(left, -jerk * body.a.signum());
                return;
            }
            body.advance(time, -jerk * body.a.signum());
            (body.v, body.a) = (goal, 0.0);
            if limit.is_some() {
                body.advance(left - time, 0.0);
            }
            return;
        }
        let sign = if rest < goal { 1.0 } else { -1.0 };
        let (v, a, w) = (body.v * sign, body.a * sign, goal * sign);
        let falling = v < -small_v;
        let bound = if falling { fall } else { grow };
        // The curve that ends at velocity 0 with the acceleration that may be there.
        let curve = grow * grow / (2.0 * jerk) - (v + a * a / (2.0 * jerk));
        let braked = falling && fall > grow;
        let mut snap = None;
        let to_goal = |t: f64, now: &mut f64| *now = now.min(t);
        let (mut time, j);
        if a < 0.0 {
            (time, j) = (-a / jerk, jerk);
            snap = Some(0.0);
        } else if braked && a > grow + small_a && curve <= small_v {
            (time, j) = ((a - grow) / jerk, -jerk);
            snap = Some(grow);
        } else if a > bound + small_a {
            (time, j) = ((a - bound) / jerk, -jerk);
            snap = Some(bound);
            if falling {
                let disc = a * a + 2.0 * jerk * v;
                if disc > 0.0 {
                    let zero = -2.0 * v / (a + disc.sqrt());
                    if zero < time {
                        (time, snap) = (zero, None);
                    }
                }
            }
        } else if a < bound - small_a {
            (time, j) = ((bound - a) / jerk, jerk);
            snap = Some(bound);
            let mut other = least(jerk, 2.0 * a, rest * sign - w);
            if falling {
                to_goal(least(jerk / 2.0, a, v), &mut other);
            }
            if braked && a + small_a >= grow {
                to_goal(least(jerk, 2.0 * a, -curve), &mut other);
            } else if braked {
                to_goal((grow - a) / jerk, &mut other);
            }
            if other < time {
                (time, snap) = (other, None);
            }
        } else {
            j = 0.0;
            time = (w - rest * sign) / a;
            if falling {
                time = time.min(-v / a);
            }
            if braked && a > grow + small_a {
                time = time.min(curve / a);
            }
        }
        if time >= left {
            body.advance(left, j * sign);
            return;
        }
        // Rounding must not stop the clockwork.
        body.advance(time.max(1e-18), j * sign);
        if let Some(a) = snap {
            body.a = a * sign;
        }
        if body.v.abs() <= small_v {
            body.v = 0.0;
        }
    }
    panic!("the play does not end");
}

fn play(from: &State, limits: &Limits, highest: f64, push: f64, last: f64) -> Played {
    let mut body = Body { p: 0.0, v: from.velocity, a: from.acceleration, t: 0.0 };
    toward(&mut body, highest, Some(push), limits);
    toward(&mut body, last, None, limits);
    Played { position: body.p, time: body.t }
}

/// Time and way of going to a velocity at once.
pub(crate) fn reach(from: &State, limits: &Limits, velocity: f64) -> Played {
    play(from, limits, velocity, 0.0, velocity)
}

/// The least time in which the target can be reached with velocity `last`.
pub(crate) fn least_time(from: &State, limits: &Limits, target: f64, last: f64) -> f64 {
    let way = target - from.position;
    let direct = reach(from, limits, last);
    let sign = (way - direct.position).signum();
    if way == direct.position {
        return direct.time;
    }
    let highest = limits.velocity() * sign;
    let miss = |push: f64| {
        let played = play(from, limits, highest, push, last);
        ((played.position - way) * sign, played.time)
    };
    let (mut low, mut high) = (0.0, direct.time.max(1e-6));
    if last != 0.0 {
        // The way need not grow steadily with the push: the first push that is long enough counts.
        let most = 2.0 * direct.time + highest.abs() / limits.acceleration();
        let steps = 1..400;
        for push in steps.map(|step| most * (f64::from(step) / 400.0).powi(2)) {
            high = push;
            if miss(push).0 >= 0.0 {
                break;
            }
            low = push;
        }
    }
    while miss(high).0 < 0.0 {
        low = high;
        high *= 2.0;
        assert!(high < 1e12, "no push is long enough");
    }
    let (mut below, mut above) = (miss(low).0, miss(high).0);
    let mut side = 0;
    for turn in 0..400 {
        let secant = (low * above - high * below) / (above - below);
        let middle = (low + high) / 2.0;
        let x = if turn % 3 != 2 && secant > low && secant < high { secant } else { middle };
        if x <= low || x >= high {
            break;
        }
        let value = miss(x).0;
        if value <= 0.0 {
            (low, below) = (x, value);
            if side == -1 {
                above /= 2.0;
            }
            side = -1;
        } else {
            (high, above) = (x, value);
            if side == 1 {
                below /= 2.0;
            }
            side = 1;
        }
    }
    miss((low + high) / 2.0).1
}
