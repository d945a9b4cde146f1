// SPDX-License-Identifier: MPL-2.0

//! People in recordings that the test makes itself: followed within one, and in one as it is.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::{
    fmt::Write,
    fs,
    path::{Path, PathBuf},
    process::Command,
};

use evaluation::{
    Experiment, Scene, SceneError, Target, Whom,
    metrics::Metrics,
    motchallenge::write_recording,
    record::{Codec, FirstBox, Run, TrackerName},
    report,
};
use gst::prelude::*;

const WIDTH: usize = 480;
const HEIGHT: usize = 320;
const PICTURES: usize = 50;
/// Person 4 walks from left to right, person 7 above them the other way.
const WALKS: [Walk; 2] =
    [Walk { id: 4, left: 170.0, step: 5.0, top: 150 }, Walk { id: 7, left: 400.0, step: -6.0, top: 40 }];
/// Width and height of a person, pixels.
const BOX: (usize, usize) = (32, 72);

/// A patterned box that moves sideways.
struct Walk {
    id: u32,
    left: f64,
    step: f64,
    top: usize,
}

impl Walk {
    fn left(&self, picture: usize) -> usize {
        (self.left + self.step * picture as f64).round() as usize
    }
}

/// Grey of squares of four pixels: anything, but always the same.
fn pattern(x: usize, y: usize, kind: u32) -> u8 {
    let square = (x as u32 / 4 * 7919) ^ (y as u32 / 4 * 104_729) ^ (kind * 15_485_863);
    (square.wrapping_mul(2_654_435_761) >> 24) as u8
}

fn picture(number: usize) -> Vec<u8> {
    let mut picture = vec![128; WIDTH * HEIGHT * 3 / 2];
    for (at, grey) in picture.iter_mut().take(WIDTH * HEIGHT).enumerate() {
        let (x, y) = (at % WIDTH, at / WIDTH);
        *grey = 90 + pattern(x, y, 0) / 8;
        for walk in &WALKS {
            let (right, down) = (x.wrapping_sub(walk.left(number)), y.wrapping_sub(walk.top));
            if right < BOX.0 && down < BOX.1 {
                *grey = 16 + pattern(right, down, walk.id) / 5 * 4;
            }
        }
    }
    picture
}

/// The recording and its ground truth.
fn recording(name: &str) -> (PathBuf, PathBuf) {
    evaluation::init().unwrap();
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR"));
    let (file, truth) = (folder.join(format!("{name}.mkv")), folder.join(format!("{name}.csv")));
    let pipeline = gst::parse::launch(&format!(
        "appsrc name=source format=time caps=video/x-raw,format=I420,width={WIDTH},height={HEIGHT},framerate=25/1 \
         ! jpegenc quality=90 ! matroskamux ! filesink name=file"
    ))
    .unwrap()
    .downcast::<gst::Pipeline>()
    .unwrap();
    pipeline.by_name("file").unwrap().set_property("location", &file);
    let source = pipeline.by_name("source").and_downcast::<gst_app::AppSrc>().unwrap();
    pipeline.set_state(gst::State::Playing).unwrap();
    let mut lines = String::new();
    for number in 0..PICTURES {
        let mut buffer = gst::Buffer::from_slice(picture(number));
        let stamped = buffer.get_mut().unwrap();
        stamped.set_pts(gst::ClockTime::from_mseconds(40 * number as u64));
        stamped.set_duration(gst::ClockTime::from_mseconds(40));
        source.push_buffer(buffer).unwrap();
        for walk in &WALKS {
            let (left, (width, height)) = (walk.left(number), BOX);
            writeln!(lines, "{},{},{left},{},{width},{height},1,1,1", number + 1, walk.id, walk.top).unwrap();
        }
    }
    source.end_of_stream().unwrap();
    let ends = [gst::MessageType::Eos, gst::MessageType::Error];
    let end = pipeline.bus().unwrap().timed_pop_filtered(gst::ClockTime::from_seconds(60), &ends);
    pipeline.set_state(gst::State::Null).unwrap();
    assert_eq!(end.unwrap().type_(), gst::MessageType::Eos);
    fs::write(&truth, lines).unwrap();
    (file, truth)
}

#[track_caller]
fn run(scene: &Scene, tracker: TrackerName) -> Run {
    let run = evaluation::run(&Experiment {
        size: (320, 240),
        first_box: FirstBox::Given,
        ..Experiment::new(scene.clone(), tracker, 1)
    });
    assert_eq!(run.error, None);
    run
}

#[test]
fn a_camera_follows_one_person_within_a_recording() {
    let (file, truth) = recording("closed-loop");
    let scene = Scene::footage(&file, &truth, Whom::Longest, (320, 240)).unwrap().remove(0);
    assert_eq!((scene.title.as_str(), scene.target), ("closed-loop, person 4", Target::Person(4)));

    let oracle = run(&scene, TrackerName::Oracle);
    let metrics = Metrics::of(&oracle);
    assert_eq!((metrics.precision, metrics.detection_precision), (Some(1.0), Some(1.0)));
    assert_eq!((metrics.track_fragmentation, metrics.identity_switches), (Some(0.0), Some(0)));
    assert_eq!(metrics.success, Some(1.0));
    assert!(oracle.frames.last().unwrap().pan_deg > 5.0, "{:?}", oracle.frames.last());
    assert!(oracle.frames.iter().all(|frame| frame.others.len() == 1 && frame.others[0].id == 7));

    let still = Metrics::of(&run(&scene, TrackerName::Still));
    assert!(still.track_fragmentation.unwrap() > 0.1, "{still:?}");

    let ours = run(&scene, TrackerName::Ptztrack);
    assert!(ours.frames.iter().any(|frame| frame.commands > 0));
}

#[test]
fn in_a_recording_as_it_is_the_box_is_judged() {
    let (file, truth) = recording("as-it-is");
    let scene = Scene::recordings(&file, &truth, Whom::Person(7)).unwrap().remove(0);
    let oracle = run(&scene, TrackerName::Oracle);
    assert_eq!((oracle.size, oracle.frame_rate), ((WIDTH as u32, HEIGHT as u32), 25.0));
    assert_eq!((oracle.codec, oracle.delays.total().as_millis()), (Codec::Raw, 0));
    let metrics = Metrics::of(&oracle);
    assert_eq!((metrics.frames, metrics.success, metrics.box_precision), (PICTURES, Some(1.0), Some(1.0)));

    let ours = run(&scene, TrackerName::Ptztrack);
    assert!(ours == run(&scene, TrackerName::Ptztrack), "twice is not the same");
    let metrics = Metrics::of(&ours);
    assert!(metrics.box_precision.unwrap() > 0.9 && metrics.success.unwrap() > 0.4, "{metrics:?}");
    assert_eq!(metrics.identity_switches, Some(0));

    let out = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("as-it-is");
    report::write(&[ours, oracle], &[], &out).unwrap();
    let results = fs::read_to_string(out.join("results.csv")).unwrap();
    let mut lines = results.lines();
    assert!(lines.next().unwrap().contains(",identity_switches,box_precision_20px_pct,"));
    assert!(lines.next().unwrap().starts_with("\"as-it-is, person 7\",,ptztrack,1,raw,480,320,given,0,0,"));
    assert!(lines.next().unwrap().contains(",0.000000,100.000000,recording,"), "{results}");
    let page = fs::read_to_string(out.join("index.html")).unwrap();
    assert!(page.contains("<th scope=\"row\">as-it-is, person 7</th>"));
}

#[test]
fn it_ends_with_the_persons_last_box() {
    let (file, truth) = recording("last-box");
    let early: String = (1..=20).map(|frame| format!("{frame},4,200,150,32,72,1,1,1\n")).collect();
    fs::write(&truth, early).unwrap();
    let closed = Scene::footage(&file, &truth, Whom::Longest, (320, 240)).unwrap().remove(0);
    let as_it_is = Scene::recordings(&file, &truth, Whom::Longest).unwrap().remove(0);
    assert_eq!([closed, as_it_is].map(|scene| run(&scene, TrackerName::Still).frames.len()), [20, 20]);
}

#[test]
fn everybody_in_a_recording_is_written_as_the_motchallenge_has_it() {
    let (file, truth) = recording("everybody");
    let out = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("everybody");
    write_recording(&file, &truth, None, &out).unwrap();
    let read = |name: &str| fs::read_to_string(out.join(name)).unwrap();
    let boxes = |text: &str| -> Vec<Vec<f64>> {
        text.lines().map(|line| line.split(',').map(|field| field.parse().unwrap()).collect()).collect()
    };
    assert!(read("gt/everybody/seqinfo.ini").contains("\nframeRate=25.000\nseqLength=50\nimWidth=480\n"));
    let (written, given) =
        (boxes(&read("gt/everybody/gt/gt.txt")), boxes(&fs::read_to_string(&truth).unwrap()));
    assert_eq!(written, given);
    // Both walk before a background that has to be learned first.
    let regions = boxes(&read("gt/everybody/det/det.txt"));
    for walk in &WALKS {
        let on_them = regions.iter().filter(|region| {
            let left = walk.left(region[0] as usize - 1) as f64;
            (region[2] - left).abs() < 20.0 && (region[3] - walk.top as f64).abs() < 20.0
        });
        assert!(on_them.count() > PICTURES / 3, "person {}: {regions:?}", walk.id);
    }
    assert!(boxes(&read("ptztrack/data/everybody.txt")).iter().all(|track| track[1] >= 1.0));
    write_recording(&file, &truth, Some("identity name=tracker"), &out).unwrap();
    assert_eq!(read("gt/everybody/det/det.txt"), "", "other elements see nobody");
    let nowhere = write_recording(&out, &file.with_extension("csv"), None, &out).unwrap_err().to_string();
    assert!(nowhere.starts_with(&out.display().to_string()), "{nowhere}");
}

/// The other side of the same text.
#[test]
fn the_scorer_reads_what_it_writes() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("everybody");
    let mut python = Command::new("python3");
    let output =
        python.args(["-B", "-m", "unittest", "test_motchallenge"]).current_dir(folder).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
}

#[test]
fn what_cannot_be_used_is_told_of_in_words() {
    let (file, truth) = recording("refused");
    let nobody = Scene::recordings(&file, &truth, Whom::Person(5));
    assert!(matches!(nobody, Err(SceneError::Person(5))), "{nobody:?}");
    let no_truth = Scene::footage(&file, &file.with_extension("txt"), Whom::Longest, (320, 240)).unwrap_err();
    assert!(no_truth.to_string().contains("refused.txt"), "{no_truth}");
    let no_video = Scene::footage(&truth, &truth, Whom::Longest, (320, 240)).unwrap_err();
    assert!(no_video.to_string().contains("refused.csv"), "{no_video}");
    let scene = Scene::recordings(&truth, &truth, Whom::Longest).unwrap().remove(0);
    let run = evaluation::run(&Experiment::new(scene, TrackerName::Oracle, 1));
    assert!(run.frames.is_empty() && run.error.is_some(), "{:?}", run.error);
}
