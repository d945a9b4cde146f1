// SPDX-License-Identifier: MPL-2.0

//! Scenes as MOTChallenge text, in the folders that TrackEval expects: `gt/<sequence>/gt/gt.txt` and `seqinfo.ini` for the truth,
//! `<tracker>/data/<sequence>.txt` for what was tracked. Beside the truth stand the detector's regions, `det/det.txt`, and how the
//! background moved, `camera.txt`: frame, then the homography from the picture before, row by row, in pixels.

use std::{fmt::Write, fs, io, path::Path};

use ptztrack_contract::Rect;

use super::recorded::RecordedPicture;
use crate::{
    record::{Bounds, FrameRecord, Run},
    report::slug,
};

/// One scene's texts. Boxes are left, top, width, height in pixels, frames count from 1.
#[derive(Default)]
pub(super) struct Sequence {
    frames: usize,
    truth: String,
    regions: String,
    tracked: String,
    camera: String,
}

impl Sequence {
    /// The next picture.
    pub fn add(&mut self, record: &FrameRecord, picture: &RecordedPicture, regions: &[Rect]) {
        self.frames += 1;
        let frame = self.frames;
        // Writing to a string cannot fail.
        for person in record.truth.iter().chain(&record.others).filter(|person| person.in_view > 0.0) {
            let _ = writeln!(
                self.truth,
                "{frame},{},{},1,1,{:.3}",
                person.id,
                corners(&person.bounds),
                person.visible
            );
        }
        let (width, height) = (f64::from(record.size.0), f64::from(record.size.1));
        for region in regions {
            let bounds = Bounds {
                left: region.x * width,
                top: region.y * height,
                width: region.width * width,
                height: region.height * height,
            };
            let _ = writeln!(self.regions, "{frame},-1,{},1,-1,-1,-1", corners(&bounds));
        }
        if let Some(estimate) = record.estimate.as_ref().filter(|estimate| estimate.has_place()) {
            let _ =
                writeln!(self.tracked, "{frame},{},{},1,-1,-1,-1", estimate.id, corners(&estimate.bounds));
        }
        if let Some(motion) = picture.motion {
            let numbers: Vec<_> = motion.as_flattened().iter().map(|number| format!("{number:e}")).collect();
            let _ = writeln!(self.camera, "{frame},{}", numbers.join(","));
        }
    }

    /// Writes all of it into `folder`.
    pub fn write(&self, folder: &Path, run: &Run) -> io::Result<()> {
        let name = slug(&run.title);
        let (width, height) = run.size;
        let info = format!(
            "[Sequence]\nname={name}\nframeRate={:.3}\nseqLength={}\nimWidth={width}\nimHeight={height}\n",
            run.frame_rate, self.frames
        );
        let truth = folder.join("gt").join(&name);
        let files = [
            (truth.join("gt/gt.txt"), &self.truth),
            (truth.join("det/det.txt"), &self.regions),
            (truth.join("camera.txt"), &self.camera),
            (truth.join("seqinfo.ini"), &info),
            (folder.join(run.tracker.name()).join("data").join(format!("{name}.txt")), &self.tracked),
        ];
        for (file, text) in files {
            fs::create_dir_all(file.parent().unwrap_or(folder))?;
            fs::write(file, text)?;
        }
        Ok(())
    }
}

fn corners(bounds: &Bounds) -> String {
    format!("{:.2},{:.2},{:.2},{:.2}", bounds.left, bounds.top, bounds.width, bounds.height)
}
