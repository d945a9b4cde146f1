// SPDX-License-Identifier: MPL-2.0

//! What the processes that follow take, over time.

use std::fmt::Write;
use std::fs;
use std::path::Path;
use std::process::Command;
use std::sync::atomic::Ordering;
use std::time::Duration;

use end_to_end::Usage;

use crate::camera::Probe;

/// One process at one moment.
#[derive(Debug, Clone, Copy)]
pub struct Sample {
    pub camera: usize,
    pub usage: Usage,
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
        let before = self.0.iter().map(|sample| &sample.usage).rfind(|usage| usage.process == process);
        let Some(usage) = Usage::of(process, time, before) else { return };
        let requests = probe.camera.status().requests;
        self.0.push(Sample { camera: probe.number, usage, requests });
    }

    /// Of one camera.
    fn of(&self, camera: usize) -> Vec<Sample> {
        self.0.iter().filter(|sample| sample.camera == camera).copied().collect()
    }

    /// What the process of one camera took.
    pub fn usages(&self, camera: usize) -> Vec<Usage> {
        self.of(camera).iter().map(|sample| sample.usage).collect()
    }

    /// As a table, and as a plot of it.
    pub fn write(&self, out: &Path) {
        let mut table = "# time_s,camera,process,memory_mb,threads,files,requests_per_s\n".to_owned();
        // The plot shows the first four, whether they are there or not.
        let cameras = self.0.iter().map(|sample| sample.camera + 1).max().unwrap_or(0).max(4);
        for camera in 0..cameras {
            let samples = self.of(camera);
            for pair in samples.windows(2) {
                let (a, b) = (pair[0], pair[1]);
                let rate = (b.requests - a.requests) as f64 / (b.usage.time_s - a.usage.time_s);
                let Usage { time_s, process, memory_mb, threads, files, .. } = b.usage;
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
