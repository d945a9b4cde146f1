// SPDX-License-Identifier: MPL-2.0

//! Plots, drawn by gnuplot where it is installed.

use std::{
    io::{self, Write},
    path::Path,
    process::{Command, Stdio},
};

use super::judged::{Judged, Section, slug};
use crate::{
    metrics::{d_gc, d_gp, is_hidden},
    record::{FrameRecord, TrackerName},
};

/// A picture that is still to be drawn.
pub struct Plot {
    /// Name of the file without folder.
    pub file: String,
    /// What it shows.
    pub caption: String,
    script: String,
}

impl Plot {
    /// d_gc and d_gp over time of all trackers in one test, as in the thesis' figures 5.10 to 5.13.
    pub fn over_time(section: &Section, title: &str) -> Self {
        let runs: Vec<&Judged> = section.showing(title).collect();
        let seed = runs.first().map_or(0, |one| one.run.seed);
        let file = format!("time-{}-{}.png", slug(title), slug(&section.setup.folder(seed)));
        let panel = |block: &str, axis: &str, top: &str| {
            let data = runs.iter().map(|one| Curve::of(block, one.run.tracker));
            format!("set ylabel \"{axis}\"\nset yrange [0:{top}]\n{}", plot(data))
        };
        let data: String = runs
            .iter()
            .map(|one| {
                block("gc", one.run.tracker, &one.run.frames, d_gc)
                    + &block("gp", one.run.tracker, &one.run.frames, d_gp)
            })
            .collect();
        let hidden: String = runs.first().map(|one| shade_hidden(&one.run.frames)).unwrap_or_default();
        let header = header(&file, 800, "seconds since the first box");
        let last = runs.iter().filter_map(|one| one.run.frames.last()).map(|frame| frame.time_s);
        // A range of nothing is an error.
        let end = last.fold(0.1, f64::max);
        let title = title.replace('\'', "''");
        let frame =
            format!("set xrange [0:{end:.3}]\nset multiplot layout 2, 1 title '{title}' noenhanced\n");
        let above = panel("gc", "d_{gc} (1: surely outside)", "*<1.5");
        let below = panel("gp", "d_{gp} (while tracking)", "0.05<*<0.75");
        Self {
            caption: format!(
                "{title}: d_gc (above) and d_gp (below) over time; grey: the person is wholly hidden"
            ),
            script: format!("{header}{data}{hidden}{frame}{above}{below}unset multiplot\n"),
            file,
        }
    }

    /// Draws it into a folder.
    ///
    /// # Errors
    /// Where gnuplot is missing or fails.
    pub fn draw(&self, folder: &Path) -> io::Result<()> {
        let gnuplot = Command::new("gnuplot")
            .current_dir(folder)
            .stdin(Stdio::piped())
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn();
        let mut gnuplot = gnuplot.map_err(|error| match error.kind() {
            io::ErrorKind::NotFound => {
                io::Error::other("there is no gnuplot; install it (Debian: gnuplot-nox)")
            }
            _ => error,
        })?;
        // Where it stops reading, what it says of that is worth more than the broken pipe.
        let written =
            gnuplot.stdin.take().map_or(Ok(()), |mut input| input.write_all(self.script.as_bytes()));
        let output = gnuplot.wait_with_output()?;
        if output.status.success() {
            return written;
        }
        let said = String::from_utf8_lossy(&output.stderr);
        let why = said.lines().map(str::trim).rfind(|line| !line.is_empty()).unwrap_or("without a word");
        Err(io::Error::other(format!("gnuplot failed ({}): {why}", output.status)))
    }
}

struct Curve {
    block: String,
    tracker: TrackerName,
}

impl Curve {
    fn of(block: &str, tracker: TrackerName) -> Self {
        Self { block: format!("${block}_{}", variable(tracker)), tracker }
    }
}

fn header(file: &str, height: u32, x: &str) -> String {
    format!(
        "set terminal pngcairo size 1200, {height} font \"DejaVu Sans,11\" background \"white\"\n\
         set output \"{file}\"\nset grid back linecolor rgb \"#dddddd\"\n\
         set key outside right top vertical\nset xlabel \"{x}\"\n"
    )
}

/// One line a tracker, ours the thickest.
fn plot(curves: impl Iterator<Item = Curve>) -> String {
    let curves: Vec<_> = curves
        .map(|Curve { block, tracker }| {
            let width = if tracker == TrackerName::Ptztrack { 3 } else { 2 };
            let colour = colour(tracker);
            format!("{block} using 1:2 with lines linewidth {width} linecolor rgb \"{colour}\" title \"{tracker}\"")
        })
        .collect();
    if curves.is_empty() { String::new() } else { format!("plot {}\n", curves.join(", \\\n  ")) }
}

fn block(
    name: &str,
    tracker: TrackerName,
    frames: &[FrameRecord],
    of: fn(&FrameRecord) -> Option<f64>,
) -> String {
    datablock(name, tracker, frames.iter().map(|frame| (frame.time_s, of(frame))))
}

/// Data in the script itself; no line is drawn across what is missing.
fn datablock(name: &str, tracker: TrackerName, points: impl Iterator<Item = (f64, Option<f64>)>) -> String {
    let line = |(x, y): (f64, Option<f64>)| match y {
        Some(y) => format!("{x:.6} {y:.6}\n"),
        None => format!("{x:.6} NaN\n"),
    };
    format!("${name}_{} << END\n{}END\n", variable(tracker), points.map(line).collect::<String>())
}

/// As part of a variable's name.
fn variable(tracker: TrackerName) -> String {
    tracker.name().replace('-', "_")
}

fn shade_hidden(frames: &[FrameRecord]) -> String {
    let stretches =
        frames.chunk_by(|a, b| is_hidden(a) == is_hidden(b)).filter(|stretch| is_hidden(&stretch[0]));
    stretches
        .filter_map(|stretch| {
            let (from, to) = (stretch.first()?.time_s, stretch.last()?.time_s);
            Some(format!(
                "set object rectangle from {from:.3}, graph 0 to {to:.3}, graph 1 behind fillcolor rgb \"#dddddd\" fillstyle solid noborder\n"
            ))
        })
        .collect()
}

/// Told apart by people who do not see red or green, too (Okabe and Ito).
pub fn colour(tracker: TrackerName) -> &'static str {
    match tracker {
        TrackerName::Ptztrack => "#0072b2",
        TrackerName::Thesis => "#d55e00",
        TrackerName::Csrt => "#009e73",
        TrackerName::Kcf => "#cc79a7",
        TrackerName::Mosse => "#e69f00",
        TrackerName::MedianFlow => "#56b4e9",
        TrackerName::RelativeMoves => "#f0e442",
        TrackerName::BoxPid => "#8c510a",
        TrackerName::KcfPredicted => "#aa4499",
        TrackerName::Oracle => "#000000",
        TrackerName::OracleEgo => "#444444",
        TrackerName::OracleXray => "#777777",
        TrackerName::Still => "#999999",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gnuplot_tells_itself_why_it_failed() {
        let plot =
            Plot { file: "none.png".into(), caption: String::new(), script: "plot nonsense(\n".into() };
        let told = plot.draw(&std::env::temp_dir()).unwrap_err().to_string();
        let there = Command::new("gnuplot").arg("--version").output().is_ok();
        assert_eq!(told.contains("install"), !there, "{told}");
        assert_eq!(told.contains("): "), there, "{told}");
        assert!(!told.ends_with("without a word"), "{told}");
    }
}
