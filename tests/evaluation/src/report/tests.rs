// SPDX-License-Identifier: MPL-2.0

//! Reports of runs that nobody ran.

use std::{collections::BTreeMap, fs, path::PathBuf};

use super::*;
use crate::record::{
    Bounds, Estimate, FrameRecord, GroundTruth, Moment, Run, Snapshot, TargetState, TrackerName,
};

/// Of one test, gone at its end.
struct Folder(PathBuf);

impl Folder {
    fn new(name: &str) -> Self {
        let folder = std::env::temp_dir().join(format!("ptztrack-report-{name}-{}", std::process::id()));
        let _ = fs::remove_dir_all(&folder);
        Self(folder)
    }

    fn read(&self, file: &str) -> String {
        fs::read_to_string(self.0.join(file)).unwrap_or_else(|error| panic!("{file}: {error}"))
    }

    /// Every file with its bytes.
    fn all(&self) -> BTreeMap<PathBuf, Vec<u8>> {
        let mut files = BTreeMap::new();
        let mut folders = vec![self.0.clone()];
        while let Some(folder) = folders.pop() {
            for path in fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()) {
                if path.is_dir() {
                    folders.push(path);
                } else {
                    files.insert(path.strip_prefix(&self.0).unwrap().into(), fs::read(&path).unwrap());
                }
            }
        }
        files
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
    }
}

/// The person stands 3 pixels right and 4 below the middle of 80x60 pixels (d_gc 0.1) and is hidden in frames 5 to 9.
fn frame(index: usize, tracked: bool) -> FrameRecord {
    let bounds = Bounds { left: 38.0, top: 24.0, width: 10.0, height: 20.0 };
    let unhidden = if (5..10).contains(&index) { 0.0 } else { 1.0 };
    let truth = GroundTruth {
        id: 1,
        bounds,
        centroid: (43.0, 34.0),
        visible: unhidden,
        unhidden,
        in_view: 1.0,
        position_m: None,
        direction_deg: None,
    };
    let estimate =
        Estimate { state: TargetState::Tracking, centroid: (43.0, 29.0), bounds, id: 3, features: 12 };
    made_up::judged_by_boxes(FrameRecord {
        time_s: index as f64 / 10.0,
        truth: Some(truth),
        estimate: tracked.then_some(estimate),
        pan_deg: -1.5,
        commands: 1,
        ..made_up::frame((80, 60))
    })
}

fn run(test: u32, tracker: TrackerName) -> Run {
    let tracked = tracker != TrackerName::Still;
    Run {
        test: Some(TestId(test)),
        title: format!("test {test}"),
        tracker,
        snapshots: vec![Snapshot { moment: Moment::Acquired, frame: 2, jpeg: vec![0xff, 0xd8, 0xff] }],
        ..made_up::run((0..40).map(|index| frame(index, tracked)).collect())
    }
}

fn runs() -> Vec<Run> {
    [1, 7, 40]
        .into_iter()
        .flat_map(|test| [TrackerName::Ptztrack, TrackerName::Still].map(|name| run(test, name)))
        .collect()
}

#[test]
fn has_every_run_and_figure() {
    let folder = Folder::new("figures");
    let report = write(&runs(), &[], &folder.0).unwrap();
    let results = folder.read("results.csv");
    let lines: Vec<_> = results.lines().collect();
    assert_eq!(lines.len(), 1 + 6);
    // 35 right and 5 wrong of 40; d_gp is 5 of 100 pixels; all 40 lie on the person; the boxes are the same; d_gc 0.1 is
    // not central.
    let ours = "test 1,1,ptztrack,1,mjpeg,80,60,given,100,60,40,35,87.500000,100.000000,0.000000,\
                0.100000,0.000000,0.050000,0.000000,100.000000,100.000000,,,0.000000,0.000000,100.000000,10.000000,,";
    assert!(lines[1].starts_with(ours), "{}", lines[1]);
    assert!(lines[1].ends_with(",room,1,t,s,l,"), "{}", lines[1]);
    let still = "test 1,1,still,1,mjpeg,80,60,given,100,60,40,35,,0.000000,0.000000,0.100000,0.000000,,,,";
    assert!(lines[2].starts_with(still), "{}", lines[2]);
    let losses = folder.read("losses.csv");
    assert_eq!(
        losses.lines().filter(|line| line.contains(",still,1,given,never acquired,0.000000,")).count(),
        3
    );
    assert_eq!(losses.lines().count(), 1 + 3);

    let ours = report.summary.lines().find(|line| line.starts_with("| ptztrack")).unwrap();
    let cells: Vec<_> = ours.split('|').map(str::trim).filter(|cell| !cell.is_empty()).collect();
    assert_eq!(cells, ["ptztrack", "3", "87.5", "100.0", "100.0", "0.0", "100.0", "0.100", "—", "—", "0.00"]);
    let still = report.summary.lines().find(|line| line.starts_with("| still")).unwrap();
    assert!(still.split('|').nth(3).unwrap().trim() == "—", "never tracked, no precision: {still}");
    assert!(
        report.summary.contains("| never acquired                         |        0 |      3 |"),
        "{}",
        report.summary
    );
    assert!(folder.read("summary.md").starts_with(&report.summary));
}

#[test]
fn the_thesis_stands_beside_the_tests_that_were_run() {
    let folder = Folder::new("thesis");
    write(&runs(), &[], &folder.0).unwrap();
    assert!(folder.read("tests.md").contains("87.5 (92.8)"), "{}", folder.read("tests.md"));
    // Tests 1 and 40 are unoccluded: (92.81 + 80.66) / 2.
    let page = folder.read("index.html");
    assert!(page.contains("<td>86.7</td>"), "{page}");
    assert!(!page.contains("<th>full occlusion</th>"), "none was run");
}

#[test]
fn csv_reads_again() {
    let mut runs = runs();
    runs[0].title = "a, \"b\"".into();
    runs[0].error = Some("no\nframes".into());
    let folder = Folder::new("csv");
    let report = write(&runs, &[], &folder.0).unwrap();
    assert!(folder.read("results.csv").contains("\n\"a, \"\"b\"\"\",1,ptztrack,"));
    assert!(folder.read("results.csv").contains(",\"no\nframes\"\n"));
    assert!(report.notes.iter().any(|note| note.contains("no\nframes")), "{:?}", report.notes);
    let frames =
        folder.read("frames/room/seed1-mjpeg-80x60-given-video100ms-command60ms/test-7-ptztrack.csv");
    let columns: Vec<_> = frames.lines().map(|line| line.split(',').count()).collect();
    assert!(columns.len() == 41 && columns.iter().all(|number| *number == columns[0]), "{columns:?}");
    assert!(frames.contains("\n0.200000,1.000000,"), "{frames}");
    let still = folder.read("frames/room/seed1-mjpeg-80x60-given-video100ms-command60ms/test-7-still.csv");
    assert!(still.lines().all(|line| line.split(',').count() == columns[0]));
}

#[test]
fn the_page_needs_no_other_file() {
    let folder = Folder::new("page");
    let mut runs = runs();
    runs[0].error = Some("<broken> & gone".into());
    let report = write(&runs, &[], &folder.0).unwrap();
    let page = folder.read("index.html");
    assert!(page.contains("&lt;broken&gt; &amp; gone") && !page.contains("<broken>"));
    assert!(page.contains("data:image/jpeg;base64,/9j/\""), "the picture of a moment");
    assert!(!page.contains("http") && !page.contains("src=\"plots"), "nothing from elsewhere");
    assert!(page.contains("acquired") && page.contains("12 features") && page.contains("What is counted"));
    let plots = page.matches("data:image/png;base64,").count();
    let drawn = report.notes.iter().all(|note| !note.contains("gnuplot"));
    assert_eq!(plots, if drawn { 2 } else { 0 }, "tests 1 and 7: {:?}", report.notes);
}

#[test]
fn same_runs_give_same_bytes_in_any_order() {
    let (one, other) = (Folder::new("one"), Folder::new("other"));
    let mut runs = runs();
    write(&runs, &[], &one.0).unwrap();
    runs.reverse();
    write(&runs, &[], &other.0).unwrap();
    assert!(one.all() == other.all());
    assert!(one.all().len() >= 9);
}

#[test]
fn a_run_that_failed_keeps_its_line_and_is_in_no_mean() {
    let folder = Folder::new("failed");
    let broken = Run { error: Some("broke off".into()), ..run(40, TrackerName::Ptztrack) };
    let broken = Run { frames: (0..40).map(|index| frame(index, index < 5)).collect(), ..broken };
    write(&[run(1, TrackerName::Ptztrack), broken], &[], &folder.0).unwrap();
    assert!(folder.read("results.csv").lines().nth(2).unwrap().ends_with(",broke off"));
    let summary = folder.read("summary.md");
    assert!(summary.contains("| ptztrack           |    1 | 87.5 |"), "{summary}");
    assert!(summary.contains("\n- test 40, ptztrack failed: broke off\n"), "{summary}");
}

#[test]
fn who_was_left_out_is_told() {
    let folder = Folder::new("left-out");
    let left_out = ["csrt is skipped: <nothing> there".to_owned()];
    let report = write(&runs(), &left_out, &folder.0).unwrap();
    assert_eq!(report.notes.first(), left_out.first());
    assert!(folder.read("summary.md").contains("\n- csrt is skipped: <nothing> there\n"));
    assert!(folder.read("index.html").contains("<li>csrt is skipped: &lt;nothing&gt; there</li>"));
}

#[test]
fn an_earlier_report_leaves_nothing_and_nobody_else_loses_anything() {
    let folder = Folder::new("again");
    fs::create_dir_all(folder.0.join("frames")).unwrap();
    fs::write(folder.0.join("frames/mine.txt"), "not a report's").unwrap();
    make_room(&folder.0).unwrap();
    write(&[], &[], &folder.0).unwrap();
    assert_eq!(folder.read("frames/mine.txt"), "not a report's");
    write(&runs(), &[], &folder.0).unwrap();
    assert!(folder.all().keys().any(|file| file.ends_with("test-40-ptztrack.csv")));
    write(&[run(1, TrackerName::Oracle)], &[], &folder.0).unwrap();
    let frames: Vec<_> = folder.all().into_keys().filter(|file| file.starts_with("frames")).collect();
    assert_eq!(frames, [PathBuf::from(format!("frames/{}.csv", place(&run(1, TrackerName::Oracle))))]);
    assert!(folder.all().keys().all(|file| !file.to_string_lossy().contains("probe")));
}

#[test]
fn nothing_run_is_a_report_too() {
    let folder = Folder::new("nothing");
    let report = write(&[], &[], &folder.0).unwrap();
    assert_eq!(report, Report { summary: String::new(), notes: vec![] });
    assert_eq!(folder.read("results.csv").lines().count(), 1);
}

#[test]
fn a_folder_that_cannot_be_made_is_named() {
    let folder = Folder::new("refused");
    fs::write(&folder.0, "a file").unwrap();
    let named = format!("cannot write {}: ", folder.0.display());
    assert!(make_room(&folder.0).unwrap_err().to_string().starts_with(&named));
    let error = write(&runs(), &[], &folder.0).unwrap_err().to_string();
    assert!(error.contains("results.csv"), "{error}");
    fs::remove_file(&folder.0).unwrap();
}

#[test]
fn what_was_run_with_another_servo_or_laboratory_is_refused() {
    let folder = Folder::new("mixed");
    let other = |change: fn(&mut crate::record::Provenance)| {
        let mut run = run(7, TrackerName::Still);
        change(&mut run.provenance);
        write(&[self::run(1, TrackerName::Ptztrack), run], &[], &folder.0)
    };
    for refused in [other(|one| one.servo = "older".into()), other(|one| one.laboratory = "older".into())] {
        let error = refused.unwrap_err().to_string();
        assert!(error.contains("ptztrack on test 1, seed 1 and still on test 7, seed 1"), "{error}");
    }
    assert!(other(|one| one.tracker = "another".into()).is_ok(), "each has its own");
}

#[test]
fn rows_are_over_the_same_runs() {
    let folder = Folder::new("shared");
    let seeded = |seed, tracker| Run { seed, ..run(1, tracker) };
    let runs =
        [seeded(1, TrackerName::Ptztrack), seeded(2, TrackerName::Ptztrack), seeded(1, TrackerName::Still)];
    let summary = write(&runs, &[], &folder.0).unwrap().summary;
    assert!(
        summary.contains("Means over 1 runs of each tracker") && summary.contains("seed 1 "),
        "{summary}"
    );
    assert!(summary.contains("| ptztrack           |    1 |"), "{summary}");
}
