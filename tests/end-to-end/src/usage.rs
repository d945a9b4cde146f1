// SPDX-License-Identifier: MPL-2.0

//! What a process takes, and whether it takes more and more.

use std::fmt;
use std::fs;
use std::time::Duration;

use crate::trend::Trend;

/// What a process takes at one moment.
#[derive(Debug, Clone, Copy)]
pub struct Usage {
    /// When, from any beginning.
    pub time_s: f64,
    /// Its number.
    pub process: u32,
    /// Resident.
    pub memory_mb: f64,
    /// How many.
    pub threads: f64,
    /// How many are open.
    pub files: f64,
    /// Of all time so far, s.
    processor_s: f64,
    /// Processor cores since the moment before.
    pub cores: f64,
}

impl Usage {
    /// Of a `process` at a `time`, and since the moment `before`. Of one that has just ended there is none.
    pub fn of(process: u32, time: Duration, before: Option<&Self>) -> Option<Self> {
        let status = fs::read_to_string(format!("/proc/{process}/status")).ok()?;
        let files = fs::read_dir(format!("/proc/{process}/fd")).ok()?.count() as f64;
        let field = |name: &str| -> Option<f64> {
            status.lines().find_map(|line| line.strip_prefix(name)?.split_whitespace().next()?.parse().ok())
        };
        let (memory_kb, threads) = (field("VmRSS:")?, field("Threads:")?);
        let (time_s, processor_s) = (time.as_secs_f64(), processor_s(process).unwrap_or_default());
        let cores =
            before.map_or(0.0, |before| (processor_s - before.processor_s) / (time_s - before.time_s));
        Some(Self { time_s, process, memory_mb: memory_kb / 1024.0, threads, files, processor_s, cores })
    }
}

/// What a process has taken of the processors (proc_pid_stat(5), `utime` and `stime`).
fn processor_s(process: u32) -> Option<f64> {
    let stat = fs::read_to_string(format!("/proc/{process}/stat")).ok()?;
    let mut fields = stat.rsplit_once(')')?.1.split_whitespace().skip(11);
    let ticks: f64 = fields.next()?.parse::<f64>().ok()? + fields.next()?.parse::<f64>().ok()?;
    // SAFETY: takes and gives numbers only.
    let a_second = unsafe { libc::sysconf(libc::_SC_CLK_TCK) };
    Some(ticks / a_second as f64)
}

/// One quantity of a process over time.
#[derive(Debug)]
pub struct Growth {
    name: &'static str,
    /// Of all but the first third; `None`: there are too few moments.
    trend: Option<Trend>,
    /// By how much it may differ.
    most: f64,
}

impl Growth {
    /// What is wrong with it.
    pub fn fault(&self) -> Option<String> {
        match self.trend {
            None => Some(format!("too short to tell whether {} grew", self.name)),
            Some(trend) => self.is_grown(trend).then(|| format!("{} grew: {trend}", self.name)),
        }
    }

    fn is_grown(&self, trend: Trend) -> bool {
        trend.least_growth() > self.most
    }
}

/// Cells of a table: what, on average, in an hour (95 %), verdict.
impl fmt::Display for Growth {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.trend {
            None => write!(f, "{} | | | **too short**", self.name),
            Some(trend) if self.is_grown(trend) => write!(f, "{} | {trend} | **grown**", self.name),
            Some(trend) => write!(f, "{} | {trend} | not grown", self.name),
        }
    }
}

/// What may not grow, and by how much it may differ: by this share, and this much.
type Quantity = (&'static str, fn(&Usage) -> f64, f64, f64);
const QUANTITIES: [Quantity; 4] = [
    ("memory, MB", |usage| usage.memory_mb, 0.1, 4.0),
    ("threads", |usage| usage.threads, 0.0, 2.0),
    ("open files", |usage| usage.files, 0.0, 4.0),
    ("processor cores", |usage| usage.cores, 0.1, 0.1),
];

/// How each of them grew in one process, after the first third.
pub fn growths(moments: &[Usage]) -> Vec<Growth> {
    let settled = &moments[moments.len() / 3..];
    let growth = |(name, value, share, more): Quantity| {
        let points: Vec<_> = settled.iter().map(|usage| (usage.time_s, value(usage))).collect();
        let trend = Trend::of(&points);
        Growth { name, trend, most: trend.map_or(more, |trend| trend.mean * share + more) }
    };
    QUANTITIES.map(growth).into()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_this_process_something_is_told_and_of_none_nothing() {
        let usage = Usage::of(std::process::id(), Duration::ZERO, None).unwrap();
        assert!(usage.memory_mb > 1.0 && usage.threads >= 1.0 && usage.files >= 3.0, "{usage:?}");
        assert!(Usage::of(u32::MAX, Duration::ZERO, None).is_none());
    }

    #[test]
    fn memory_that_leaks_has_grown_and_threads_that_stay_have_not() {
        let usage = |second: u32| Usage {
            time_s: f64::from(second),
            process: 1,
            memory_mb: 50.0 + 0.1 * f64::from(second),
            threads: 20.0,
            files: 30.0,
            processor_s: 0.0,
            cores: 0.2,
        };
        let moments: Vec<_> = (0..600).map(usage).collect();
        let faults: Vec<_> = growths(&moments).iter().filter_map(Growth::fault).collect();
        assert!(faults.len() == 1 && faults[0].starts_with("memory, MB grew"), "{faults:?}");
        assert_eq!(growths(&moments[..10]).iter().filter_map(Growth::fault).count(), 4, "too short");
    }
}
