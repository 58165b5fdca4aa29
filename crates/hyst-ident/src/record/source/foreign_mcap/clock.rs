//! The times of the messages of a topic.

use std::rc::Rc;

use super::series::Series;

const NS_PER_S: i64 = 1_000_000_000;
const NS_PER_DAY: i64 = 86_400 * NS_PER_S;
/// Largest number of seconds of a time stamp (year 2223), so that its nanoseconds fit 64 bits.
const MAX_SECONDS: f64 = 8e9;
/// Fields that may have a time stamp.
const STAMPS: [&str; 3] = [".header.stamp", ".timestamp", ".stamp"];
/// Names of the two parts of a time stamp in ROS, Foxglove, Gazebo and Protobuf.
const PARTS: [(&str, &str); 5] =
    [("sec", "nanosec"), ("sec", "nsec"), ("secs", "nsecs"), ("seconds", "nanos"), ("sec", "nanoseconds")];

/// Times of messages \[ns\].
#[derive(Clone, Debug)]
pub(crate) struct Clock {
    /// The topic.
    pub(crate) topic: String,
    pub(crate) times: Rc<[i64]>,
}

/// The topic is not compared: topics with the same times have the same clock.
impl PartialEq for Clock {
    fn eq(&self, other: &Self) -> bool {
        Rc::ptr_eq(&self.times, &other.times) || self.times == other.times
    }
}

impl Clock {
    /// Returns the time stamps of the messages and removes their columns, or returns the log times. The second value is
    /// a note.
    pub(crate) fn of(series: &mut Series) -> (Self, Option<String>) {
        let topic = series.topic.clone();
        let logged =
            |series: &Series| series.logged.iter().map(|time| i64::try_from(*time).unwrap_or(i64::MAX)).collect();
        let Some((seconds, nanoseconds, times)) = stamps(series) else {
            let clock = Self { times: logged(series), topic };
            let note = (!clock.moves())
                .then(|| format!("{}: all messages have the same time, which is not used", clock.topic));
            return (clock, note);
        };
        let stated = Self { topic, times: times.into() };
        if stated.moves() {
            series.take(&seconds);
            series.take(&nanoseconds);
            return (stated, None);
        }
        let clock = Self { times: logged(series), ..stated };
        let note = format!("{}: the time stamps of its messages are all equal; the log times are used", clock.topic);
        (clock, Some(note))
    }

    /// Returns whether there is more than one time.
    pub(crate) fn moves(&self) -> bool {
        self.times.iter().any(|time| Some(time) != self.times.first())
    }

    /// Returns the times since `zero` \[ns\] in seconds.
    ///
    /// Integers are subtracted, because a double does not resolve nanoseconds since 1970.
    pub(crate) fn seconds_from(&self, zero: i64) -> Vec<f64> {
        self.times.iter().map(|time| time.saturating_sub(zero) as f64 / NS_PER_S as f64).collect()
    }
}

/// Returns the paths of the two parts of the time stamps, and the time stamps \[ns\].
fn stamps(series: &Series) -> Option<(String, String, Vec<i64>)> {
    let of = |path: &str| series.whole(path).map(|at| &series.columns[at].values);
    STAMPS.iter().flat_map(|stamp| PARTS.map(|(s, ns)| (format!("{stamp}.{s}"), format!("{stamp}.{ns}")))).find_map(
        |(s, ns)| {
            let stamp = |(s, ns): (&f64, &f64)| {
                let is_stamp = s.abs() <= MAX_SECONDS
                    && (0.0..=f64::from(u32::MAX)).contains(ns)
                    && s.fract() == 0.0
                    && ns.fract() == 0.0;
                is_stamp.then_some(*s as i64 * NS_PER_S + *ns as i64)
            };
            let times: Option<Vec<i64>> = of(&s)?.iter().zip(of(&ns)?).map(stamp).collect();
            Some((s, ns, times?))
        },
    )
}

/// Returns the zero of each clock \[ns\]: midnight before the first message.
///
/// Clocks that start within a day of one another share one zero.
pub(crate) fn zeros<'a>(clocks: impl Iterator<Item = &'a Clock>) -> Vec<i64> {
    let firsts: Vec<i64> = clocks.map(|clock| clock.times.first().copied().unwrap_or(0)).collect();
    let mut order: Vec<usize> = (0..firsts.len()).collect();
    order.sort_by_key(|at| firsts[*at]);
    let mut zeros = vec![0; firsts.len()];
    let mut before: Option<(i64, i64)> = None;
    for at in order {
        let first = firsts[at];
        let zero = match before {
            Some((previous, zero)) if first.saturating_sub(previous) <= NS_PER_DAY => zero,
            _ => first.saturating_sub(first.rem_euclid(NS_PER_DAY)),
        };
        zeros[at] = zero;
        before = Some((first, zero));
    }
    zeros
}
