//! How something repeats itself: how often, at what period, and whether some of it is missing.

/// A gap this many times the period is more than jitter: in tenths.
const GAP: i64 = 15;
/// Without a beat for so many tenths of the period it is silent: at least two are missing.
const SILENT: i64 = 25;
/// A period follows its intervals by one part in so many.
const SMOOTH: i64 = 8;

/// What is counted of something that comes again and again. Times in nanoseconds.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(crate) struct Rhythm {
    pub(crate) number: u64,
    pub(crate) first: Option<i64>,
    pub(crate) last: Option<i64>,
    /// As it is now.
    pub(crate) period: Option<i64>,
    pub(crate) shortest: Option<i64>,
    pub(crate) longest: Option<i64>,
    /// How many did not come, judged by the period before them.
    pub(crate) missed: u64,
    /// A gap that may be a new period, and how many are missing if it is none.
    doubt: Option<(i64, u64)>,
    /// Sum and number of the gaps that are its period and no holes.
    regular: (i64, u32),
    /// It began anew after the last one.
    paused: bool,
}

impl Rhythm {
    /// It came once more.
    pub(crate) fn beat(&mut self, time: Option<i64>) {
        self.number += 1;
        let before = core::mem::replace(&mut self.last, time).filter(|_| !self.paused);
        self.paused = false;
        if self.number == 1 {
            self.first = time;
        }
        let Some((time, before)) = time.zip(before) else { return };
        let gap = time.saturating_sub(before);
        if gap < 0 {
            return;
        }
        self.shortest = Some(self.shortest.map_or(gap, |shortest| shortest.min(gap)));
        self.longest = Some(self.longest.map_or(gap, |longest| longest.max(gap)));
        let Some(period) = self.period else {
            self.period = Some(gap);
            self.count_regular(gap);
            return;
        };
        match self.doubt.take() {
            // The same gap again: that is how it goes now.
            Some((new, _)) if (gap - new).abs() <= new / 4 => {
                self.period = Some(gap);
                self.count_regular(new);
                self.count_regular(gap);
                return;
            }
            Some((_, missing)) => self.missed = self.missed.saturating_add(missing),
            None => {}
        }
        if period > 0 && gap.saturating_mul(10) > period.saturating_mul(GAP) {
            let missing = gap.saturating_add(period / 2) / period - 1;
            self.doubt = Some((gap, u64::try_from(missing).unwrap_or(0)));
        } else {
            self.period = Some(period + (gap - period) / SMOOTH);
            self.count_regular(gap);
        }
    }

    const fn count_regular(&mut self, gap: i64) {
        let (sum, number) = self.regular;
        self.regular = (sum.saturating_add(gap), number.saturating_add(1));
    }

    /// How long it has been silent at a time, where it is.
    pub(crate) fn silence(&self, time: Option<i64>) -> Option<i64> {
        let (period, last) = self.period.zip(self.last).filter(|_| !self.paused)?;
        let gap = time?.saturating_sub(last);
        (period > 0 && gap.saturating_mul(10) > period.saturating_mul(SILENT)).then_some(gap)
    }

    /// How many did not come until now: those that are due since the last one, too, where it is silent.
    pub(crate) fn missed_by(&self, now: Option<i64>) -> u64 {
        let due = self.silence(now).zip(self.period).map_or(0, |(gap, period)| gap / period);
        self.missed.saturating_add(u64::try_from(due).unwrap_or(0))
    }

    /// It begins anew: what is between is no gap.
    pub(crate) const fn pause(&mut self) {
        self.paused = true;
        self.period = None;
        self.doubt = None;
    }

    /// Its period over all of the time, holes apart, in nanoseconds.
    pub(crate) fn mean(&self) -> Option<f64> {
        let (sum, number) = self.regular;
        (sum > 0).then(|| sum as f64 / f64::from(number))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn heard(times: impl IntoIterator<Item = i64>) -> Rhythm {
        let mut rhythm = Rhythm::default();
        times.into_iter().for_each(|time| rhythm.beat(Some(time)));
        rhythm
    }

    #[test]
    fn beats_that_are_missing_are_counted() {
        let rhythm = heard([0, 100, 201, 300, 700, 800, 900]);
        assert_eq!((rhythm.number, rhythm.missed), (7, 3));
        assert_eq!((rhythm.shortest, rhythm.longest), (Some(99), Some(400)));
        assert!((95..=105).contains(&rhythm.period.unwrap()), "{rhythm:?}");
        // Two gaps of different length, one behind the other.
        assert_eq!(heard([0, 100, 200, 400, 700, 800]).missed, 1 + 2);
    }

    #[test]
    fn a_new_period_is_no_loss() {
        let slower = heard([0, 100, 200, 1200, 2200, 3200]);
        assert_eq!((slower.missed, slower.period), (0, Some(1000)));
        let faster = heard((0..4).map(|n| n * 1000).chain((0..50).map(|n| 3100 + n * 100)));
        assert_eq!(faster.missed, 0);
        assert!(faster.period.unwrap() < 110, "{faster:?}");
    }

    /// A node that was away, a capture that is two: neither is its period.
    #[test]
    fn holes_and_times_that_go_back_are_not_in_the_mean() {
        assert_eq!(heard([0, 100, 200, 9000, 9100, 9200]).mean(), Some(100.0));
        assert_eq!(heard([0, 100, 200, 0, 100, 200]).mean(), Some(100.0));
        assert_eq!(heard([0, 1000, 2000, 7000, 12000]).mean(), Some(3000.0), "a new period is one");
        let rhythm = heard([0, 100, 200]);
        let silent = |time| rhythm.silence(Some(time));
        assert_eq!((silent(300), silent(450), silent(451), silent(100)), (None, None, Some(251), None));
        let missed = |time| rhythm.missed_by(Some(time));
        assert_eq!((missed(300), missed(451), missed(1000)), (0, 2, 8));
    }

    /// Gaps of all of time, again and again.
    #[test]
    fn what_is_missing_is_counted_without_overflow() {
        let round = [0, 1, i64::MAX, i64::MIN, i64::MIN + 1];
        assert_eq!(heard(round.into_iter().cycle().take(30)).missed, u64::MAX);
    }

    #[test]
    fn without_times_it_is_only_counted() {
        let mut rhythm = Rhythm::default();
        rhythm.beat(None);
        rhythm.beat(Some(5));
        rhythm.beat(None);
        rhythm.beat(Some(i64::MIN));
        rhythm.beat(Some(i64::MAX));
        rhythm.beat(Some(i64::MIN));
        assert_eq!((rhythm.number, rhythm.missed), (6, 0));
        assert_eq!(heard([3, 3, 3, 3]).period, Some(0));
        assert_eq!(heard([0, 10]).mean(), Some(10.0));
        assert_eq!(heard([3, 3, 3]).mean(), None);
        let mut again = heard([0, 100, 200]);
        again.pause();
        again.beat(Some(5000));
        assert_eq!((again.missed, again.period), (0, None));
    }
}
