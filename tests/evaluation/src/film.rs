// SPDX-License-Identifier: MPL-2.0

//! A video of a run to look at: what the tracker saw, what it said, and in white where the person really is.

use std::{
    fs,
    path::{Path, PathBuf},
};

use gst::prelude::*;
use gst_video::prelude::*;

use crate::{
    lockstep::RunError,
    pipeline::{Elements, PipelineError, lock},
    record::{Bounds, Run},
    report,
    trackers::CurrentCue,
};

/// Name of the element after which the true box is drawn.
const CANVAS: &str = "canvas";
/// Width of the true box's lines, pixels.
const LINE: usize = 2;
const WHITE: u8 = 235;

/// The file for a film of `run` among the `films`, in a folder that is made here: every setup has its own.
pub(crate) fn file(films: &Path, run: &Run) -> Result<PathBuf, RunError> {
    let file = films.join(report::place(run) + ".mkv");
    match file.parent().map_or(Ok(()), fs::create_dir_all) {
        Ok(()) => Ok(file),
        Err(source) => Err(RunError::Film { file, source }),
    }
}

/// The elements `sink`, and those that film what passes on its way there where a `file` is given.
pub(crate) fn beside(sink: &str, file: Option<&Path>) -> String {
    file.map_or_else(|| sink.into(), |file| description(sink, file))
}

fn description(sink: &str, file: &Path) -> String {
    // Quotes, so that a path may hold blanks; what would end them is kept from doing so.
    let file = file.display().to_string().replace('\\', "\\\\").replace('"', "\\\"");
    format!(
        "tee name=films films. ! {sink} films. ! ptzoverlay ! videoconvert ! video/x-raw,format=I420 \
         ! identity name={CANVAS} ! x264enc speed-preset=veryfast threads=1 ! matroskamux \
         ! filesink location=\"{file}\" async=false"
    )
}

/// Draws the true box of the cue into every picture; all of them are of the format `info`.
pub(crate) fn attach(
    pipeline: &gst::Pipeline,
    cue: &CurrentCue,
    info: &gst_video::VideoInfo,
) -> Result<(), PipelineError> {
    let (cue, info) = (cue.clone(), info.clone());
    pipeline.pad(CANVAS, "src")?.add_probe(gst::PadProbeType::BUFFER, move |_, probe| {
        let truth = lock(&cue).truth.as_ref().map(|truth| truth.bounds);
        if let Some((truth, buffer)) = truth.zip(probe.buffer_mut().map(gst::Buffer::make_mut)) {
            draw(buffer, &info, &truth);
        }
        gst::PadProbeReturn::Ok
    });
    Ok(())
}

fn draw(buffer: &mut gst::BufferRef, info: &gst_video::VideoInfo, bounds: &Bounds) {
    let Ok(mut frame) = gst_video::VideoFrameRef::from_buffer_ref_writable(buffer, info) else { return };
    let (width, height) = (frame.width() as usize, frame.height() as usize);
    let stride = frame.plane_stride().first().and_then(|stride| usize::try_from(*stride).ok());
    if let (Some(stride), Ok(luma)) = (stride, frame.plane_data_mut(0)) {
        outline(luma, stride, (width, height), bounds);
    }
}

/// Draws as much of the box as lies in a picture of `size`.
fn outline(luma: &mut [u8], stride: usize, size: (usize, usize), bounds: &Bounds) {
    // Saturates: what lies left of or above the picture ends at its edge.
    let place = |edge: f64| edge.round() as usize;
    let (left, top) = (place(bounds.left), place(bounds.top));
    let (right, bottom) = (place(bounds.left + bounds.width), place(bounds.top + bounds.height));
    for (row, line) in luma.chunks_mut(stride).enumerate().take(size.1.min(bottom)).skip(top) {
        let across = row < top + LINE || row + LINE >= bottom;
        for (column, pixel) in line.iter_mut().enumerate().take(size.0.min(right)).skip(left) {
            if across || column < left + LINE || column + LINE >= right {
                *pixel = WHITE;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        record::{Codec, FirstBox},
        report::made_up,
    };

    #[test]
    fn films_of_different_setups_do_not_overwrite_each_other() {
        let films = std::env::temp_dir().join(format!("ptztrack-films-{}", std::process::id()));
        let run = made_up::run(vec![]);
        let setups = [
            run.clone(),
            Run { seed: 2, ..run.clone() },
            Run { codec: Codec::Raw, ..run.clone() },
            Run { first_box: FirstBox::Detected, ..run.clone() },
            Run { title: "../Walk, person 3".into(), ..run },
        ];
        let files: Vec<_> = setups.iter().map(|run| file(&films, run).unwrap()).collect();
        for (index, file) in files.iter().enumerate() {
            assert!(file.parent().unwrap().is_dir() && !files[..index].contains(file), "{}", file.display());
        }
        assert!(files[4].ends_with("---walk--person-3-ptztrack.mkv"), "{}", files[4].display());
        fs::remove_dir_all(&films).unwrap();
    }

    #[test]
    fn the_box_is_drawn_as_far_as_it_is_inside() {
        let drawn = |bounds| {
            let mut luma = vec![0; 20 * 12];
            outline(&mut luma, 20, (16, 12), &bounds);
            luma.chunks(20).map(|line| line.iter().filter(|pixel| **pixel > 0).count()).collect::<Vec<_>>()
        };
        let inside = Bounds { left: 3.0, top: 2.0, width: 8.0, height: 7.0 };
        assert_eq!(drawn(inside), [0, 0, 8, 8, 4, 4, 4, 8, 8, 0, 0, 0]);
        let beyond = Bounds { left: 10.0, top: 8.0, width: 80.0, height: 70.0 };
        assert_eq!(drawn(beyond), [0, 0, 0, 0, 0, 0, 0, 0, 6, 6, 2, 2]);
        assert_eq!(drawn(Bounds { left: 30.0, ..inside }), [0; 12]);
    }
}
