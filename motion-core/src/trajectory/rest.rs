//! From standstill to standstill: the whole way is a closed form, and the same forward and backward but
//! for the bound of |a|.

use super::limits::Limits;
use super::math::{cbrt, greater, lesser, sqrt};
use super::plan::{ROUNDING, normalise};
use super::profile::{Phase, Profile, SIXTH};

/// From standstill to velocity `u`, or back: peak acceleration, and how long it is held.
#[derive(Debug, Clone, Copy)]
struct Swing {
    peak: f64,
    hold: f64,
}

impl Swing {
    /// With a peak of at most `bound`; `root` is √u.
    #[inline(always)]
    fn to(u: f64, root: f64, bound: f64, per_bound: f64) -> Self {
        Self { peak: lesser(bound, root), hold: greater(0.0, u * per_bound - bound) }
    }

    #[inline(always)]
    fn time(self) -> f64 {
        2.0 * self.peak + self.hold
    }
}

/// The peak velocity of a way `d` with nothing held back by the highest velocity: it and its root.
/// `least` and `most` are the lesser and the greater bound of |a|.
#[inline(always)]
fn peak(d: f64, least: f64, most: f64) -> (f64, f64) {
    if d <= 2.0 * least * least * least {
        // 2u√u = d
        let root = cbrt(0.5 * d);
        return (root * root, root);
    }
    // √u(√u + least) = √(2·least·d), where one side holds its bound.
    let product = sqrt(2.0 * least * d);
    let root = 2.0 * product / (least + sqrt(least * least + 4.0 * product));
    if root <= most {
        return (root * root, root);
    }
    // u²(1/least + 1/most) + u(least + most) = 2d, where both do.
    let (sum, product) = (least + most, least * most);
    let u = 4.0 * d * product / (sum * (product + sqrt(product * (product + 8.0 * d / sum))));
    (u, sqrt(u))
}

impl Profile {
    /// The way from a standstill at the start to one at the end.
    #[inline]
    pub(super) fn plan_rest(&mut self, limits: &Limits) {
        let (bounds, scale) = normalise(limits);
        let way = self.end.position - self.start;
        if way.abs() <= ROUNDING * (self.start.abs() + self.end.position.abs()) {
            return;
        }
        let d = way.abs() * scale;
        let mut u = bounds.velocity;
        let root = sqrt(u);
        let swings = |u: f64, root: f64| {
            let up = Swing::to(u, root, bounds.grow, bounds.per_grow);
            (up, Swing::to(u, root, bounds.fall, bounds.per_fall))
        };
        let (mut up, mut down) = swings(u, root);
        let rest = d - 0.5 * u * (up.time() + down.time());
        let cruise = if rest > 0.0 {
            rest / u
        } else {
            let root;
            (u, root) = peak(d, bounds.crossing(), greater(bounds.grow, bounds.fall));
            (up, down) = swings(u, root);
            0.0
        };
        self.write(limits.jerk().copysign(way), u, up, cruise, down);
    }

    /// Up, on with `u`, and down again; everything in units of the jerk.
    #[inline(always)]
    fn write(&mut self, jerk: f64, u: f64, up: Swing, cruise: f64, down: Swing) {
        let mut len = 0;
        // What does not last is written over by the next.
        let mut put =
            |lasts: bool, begin: f64, position: f64, velocity: f64, acceleration: f64, sign: f64| {
                if let Some(slot) = self.phases.get_mut(len) {
                    *slot = Phase {
                        begin,
                        position: position * jerk,
                        velocity: velocity * jerk,
                        acceleration: acceleration * jerk,
                        jerk: sign * jerk,
                    };
                    len += usize::from(lasts);
                }
            };
        let ramp = |swing: Swing| {
            let half = 0.5 * swing.peak * swing.peak;
            let held = half + swing.peak * swing.hold;
            let first = swing.peak * half * (2.0 * SIXTH);
            (half, held, first, first + 0.5 * swing.hold * (half + held))
        };
        let (half, held, first, second) = ramp(up);
        put(true, 0.0, 0.0, 0.0, 0.0, 1.0);
        put(up.hold > 0.0, up.peak, first, half, up.peak, 0.0);
        put(true, up.peak + up.hold, second, held, up.peak, -1.0);
        put(cruise > 0.0, up.time(), 0.5 * u * up.time(), u, 0.0, 0.0);
        let begin = up.time() + cruise;
        let (half, held, first, second) = ramp(down);
        put(true, begin, -0.5 * u * down.time(), u, 0.0, -1.0);
        put(down.hold > 0.0, begin + down.peak, -second, held, -down.peak, 0.0);
        put(true, begin + down.peak + down.hold, -first, half, -down.peak, 1.0);
        self.len = len as u8;
        self.tail = 2 + u8::from(up.hold > 0.0) + u8::from(cruise > 0.0);
        self.duration = begin + down.time();
    }
}
