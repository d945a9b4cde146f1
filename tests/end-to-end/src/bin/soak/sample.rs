// SPDX-License-Identifier: MPL-2.0

//! What the processes that follow take, over time.

use std::fmt::Write;
use std::fs;
use std::path::Path;
use std::process::Command;
use std::sync::atomic::Ordering;
use std::time::Duration;

use crate::camera::Probe;

/// One process at one moment.
#[derive(Debug, Clone, Copy)]
pub struct Sample {
    pub time_s: f64,
    pub camera: usize,
    /// Which changes when it was killed.
    pub process: u32,
    pub memory_mb: f64,
    pub threads: f64,
    pub files: f64,
    /// Of all time so far, s.
    processor_s: f64,
    /// Processor cores since the sample before.
    pub cores: f64,
    /// Requests to the camera so far.
    pub requests: u64,
}

/// All of them.
#[derive(Debug, Default)]
pub struct Samples(pub Vec<Sample>);

impl Samples {
    /// Of a process that has just ended there is none.
    pub fn take(&mut self, time: Duration, probe: &Probe) {
        let process = probe.process.load(Ordering::Relaxed);
        let Ok(status) = fs::read_to_string(format!("/proc/{process}/status")) else { return };
        let Ok(files) = fs::read_dir(format!("/proc/{process}/fd")) else { return };
        let field = |name: &str| -> Option<f64> {
            status.lines().find_map(|line| line.strip_prefix(name)?.split_whitespace().next()?.parse().ok())
        };
        let (Some(memory_kb), Some(threads)) = (field("VmRSS:"), field("Threads:")) else { return };
        let (time_s, processor_s) = (time.as_secs_f64(), processor_s(process).unwrap_or_default());
        let before = self.0.iter().rfind(|sample| sample.process == process);
        let cores =
            before.map_or(0.0, |sample| (processor_s - sample.processor_s) / (time_s - sample.time_s));
        self.0.push(Sample {
            time_s,
            camera: probe.number,
            process,
            memory_mb: memory_kb / 1024.0,
            threads,
            files: files.count() as f64,
            processor_s,
            cores,
            requests: probe.camera.status().requests,
        });
    }

    /// Of one camera.
    pub fn of(&self, camera: usize) -> Vec<Sample> {
        self.0.iter().filter(|sample| sample.camera == camera).copied().collect()
    }

    /// As a table, and as a plot of it.
    pub fn write(&self, out: &Path) {
        let mut table = "# time_s,camera,process,memory_mb,threads,files,requests_per_s\n".to_owned();
        for camera in 0..4 {
            let samples = self.of(camera);
            for pair in samples.windows(2) {
                let (a, b) = (pair[0], pair[1]);
                let rate = (b.requests - a.requests) as f64 / (b.time_s - a.time_s);
                let Sample { time_s, process, memory_mb, threads, files, .. } = b;
                writeln!(table, "{time_s:.1},{camera},{process},{memory_mb:.1},{threads},{files},{rate:.2}")
                    .unwrap();
            }
            // Two empty lines: gnuplot's next data set.
            table.push_str("\n\n");
        }
        fs::write(out.join("samples.csv"), table).unwrap();
        let plot = Command::new("gnuplot").current_dir(out).args(["-e", PLOT]).status();
        assert!(plot.is_ok_and(|status| status.success()), "gnuplot is needed for the plot");
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

const PLOT: &str = "
set terminal pngcairo size 1000,1000 font 'DejaVu Sans,10'; set output 'soak.png';
set datafile separator ','; set multiplot layout 4,1; set grid; set key outside right; set yrange [0:*];
name(n) = word('\"MJPEG\" \"MJPEG, killed\" \"H.264\" \"H.264, killed\"', n + 1);
set ylabel 'memory, MB'; plot for [n=0:3] 'samples.csv' index n using 1:4 with lines title name(n);
set ylabel 'threads'; plot for [n=0:3] 'samples.csv' index n using 1:5 with lines title name(n);
set ylabel 'open files'; plot for [n=0:3] 'samples.csv' index n using 1:6 with lines title name(n);
set ylabel 'requests/s'; set xlabel 'time, s';
plot for [n=0:3] 'samples.csv' index n using 1:7 with lines title name(n);
unset multiplot
";
