// SPDX-License-Identifier: MPL-2.0

//! Everybody as MOTChallenge text (arXiv:1603.00831), in the folders that TrackEval expects: `gt/<sequence>/gt/gt.txt` and
//! `seqinfo.ini` for the truth, `<tracker>/data/<sequence>.txt` for what was tracked. Beside the truth stand the detector's
//! regions, `det/det.txt`, and, where the camera turned, how the background moved, `camera.txt`: frame, then the homography from
//! the picture before, row by row, in pixels.

use std::{fmt::Write, fs, io, path::Path};

use ptztrack_contract::Rect;
use virtual_camera::{GroundTruth, Matrix};

use crate::record::Bounds;

mod listener;
mod recording;

pub(crate) use listener::{Listener, Said};
pub use recording::{RecordingError, write_recording};

/// One sequence's texts. Boxes are left, top, width, height in pixels, frames count from 1.
#[derive(Debug, Default)]
pub(crate) struct Sequence {
    /// Width and height of the pictures, pixels.
    size: (u32, u32),
    frames: usize,
    truth: String,
    regions: String,
    tracked: String,
    camera: String,
}

impl Sequence {
    /// Of pictures of `size` pixels; there are none yet.
    pub fn new(size: (u32, u32)) -> Self {
        Self { size, ..Self::default() }
    }

    /// The next picture: who is there, what was said of it, and how the background moved since the one before.
    pub fn add<'a>(
        &mut self,
        people: impl IntoIterator<Item = &'a GroundTruth>,
        said: &Said,
        motion: Option<&Matrix>,
    ) {
        self.frames += 1;
        let frame = self.frames;
        // Writing to a string cannot fail.
        for person in people.into_iter().filter(|person| person.in_view > 0.0) {
            let _ = writeln!(
                self.truth,
                "{frame},{},{},1,1,{:.3}",
                person.id,
                corners(&person.bounds),
                person.visible
            );
        }
        for region in said.regions.iter().flatten() {
            let _ = writeln!(self.regions, "{frame},-1,{},1,-1,-1,-1", corners(&self.pixels(region)));
        }
        for (track, bounds) in &said.tracks {
            let _ = writeln!(self.tracked, "{frame},{track},{},1,-1,-1,-1", corners(&self.pixels(bounds)));
        }
        if let Some(motion) = motion {
            let numbers: Vec<_> = motion.as_flattened().iter().map(|number| format!("{number:e}")).collect();
            let _ = writeln!(self.camera, "{frame},{}", numbers.join(","));
        }
    }

    /// Writes all of it into `folder`, as a sequence of that name and what `tracker` said of it.
    pub fn write(&self, folder: &Path, name: &str, tracker: &str, frame_rate: f64) -> io::Result<()> {
        let (width, height) = self.size;
        let info = format!(
            "[Sequence]\nname={name}\nframeRate={frame_rate:.3}\nseqLength={}\nimWidth={width}\nimHeight={height}\n",
            self.frames
        );
        let truth = folder.join("gt").join(name);
        let files = [
            (truth.join("gt/gt.txt"), &self.truth),
            (truth.join("det/det.txt"), &self.regions),
            (truth.join("camera.txt"), &self.camera),
            (truth.join("seqinfo.ini"), &info),
            (folder.join(tracker).join("data").join(format!("{name}.txt")), &self.tracked),
        ];
        for (file, text) in files {
            fs::create_dir_all(file.parent().unwrap_or(folder))?;
            fs::write(file, text)?;
        }
        Ok(())
    }

    fn pixels(&self, rect: &Rect) -> Bounds {
        let (across, down) = (f64::from(self.size.0), f64::from(self.size.1));
        Bounds {
            left: rect.x * across,
            top: rect.y * down,
            width: rect.width * across,
            height: rect.height * down,
        }
    }
}

fn corners(bounds: &Bounds) -> String {
    format!("{:.2},{:.2},{:.2},{:.2}", bounds.left, bounds.top, bounds.width, bounds.height)
}

#[cfg(test)]
mod tests {
    use std::path::PathBuf;

    use proptest::prelude::*;
    use virtual_camera::read_mot;

    use super::*;

    fn folder(name: &str) -> PathBuf {
        let folder = std::env::temp_dir().join(format!("motchallenge-{name}-{}", std::process::id()));
        let _ = fs::remove_dir_all(&folder);
        folder
    }

    fn person(id: u32, bounds: Bounds, visible: f64) -> GroundTruth {
        GroundTruth {
            id,
            bounds,
            centroid: bounds.centre(),
            visible,
            unhidden: visible,
            in_view: 1.0,
            position_m: None,
            direction_deg: None,
        }
    }

    #[test]
    fn a_sequence_is_laid_out_as_others_read_it() {
        let bounds = Bounds { left: -3.25, top: 40.0, width: 20.5, height: 60.0 };
        let rect = Rect { x: 0.5, y: 0.25, width: 0.1, height: 0.5 };
        let mut sequence = Sequence::new((640, 480));
        let away = GroundTruth { in_view: 0.0, ..person(8, bounds, 0.0) };
        sequence.add(
            [&person(7, bounds, 0.5), &away],
            &Said { regions: Some(vec![rect]), tracks: vec![] },
            None,
        );
        let motion = [[1.0, 0.0, -2.5], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        sequence.add([], &Said { regions: None, tracks: vec![(4, rect), (9, rect)] }, Some(&motion));
        let folder = folder("layout");
        sequence.write(&folder, "walk", "ours", 12.5).unwrap();
        let read = |file: &str| fs::read_to_string(folder.join(file)).unwrap();
        assert_eq!(read("gt/walk/gt/gt.txt"), "1,7,-3.25,40.00,20.50,60.00,1,1,0.500\n");
        assert_eq!(read("gt/walk/det/det.txt"), "1,-1,320.00,120.00,64.00,240.00,1,-1,-1,-1\n");
        assert_eq!(read("gt/walk/camera.txt"), "2,1e0,0e0,-2.5e0,0e0,1e0,0e0,0e0,0e0,1e0\n");
        assert_eq!(
            read("gt/walk/seqinfo.ini"),
            "[Sequence]\nname=walk\nframeRate=12.500\nseqLength=2\nimWidth=640\nimHeight=480\n"
        );
        let tracks: Vec<_> =
            [4, 9].map(|track| format!("2,{track},320.00,120.00,64.00,240.00,1,-1,-1,-1\n")).into();
        assert_eq!(read("ours/data/walk.txt"), tracks.concat());
        fs::remove_dir_all(folder).unwrap();
    }

    proptest! {
        #[test]
        fn the_truth_that_is_written_is_read(
            places in prop::collection::btree_map((0usize..9, 0u32..20), (-900i32..900, 1i32..900, 0u8..=4), 0..30),
        ) {
            // Numbers that the written digits hold.
            let quarters = |number: i32| f64::from(number) / 4.0;
            let people: Vec<Vec<_>> = (0..9)
                .map(|frame| {
                    let there = places.iter().filter(|((when, _), _)| *when == frame);
                    there
                        .map(|((_, id), &(place, side, visible))| {
                            let (left, width) = (quarters(place), quarters(side));
                            let bounds = Bounds { left, top: -left, width, height: 2.0 * width };
                            person(*id, bounds, f64::from(visible) / 4.0)
                        })
                        .collect()
                })
                .collect();
            let mut sequence = Sequence::new((640, 480));
            people.iter().for_each(|people| sequence.add(people, &Said::default(), None));
            let folder = folder("truth");
            sequence.write(&folder, "walk", "ours", 25.0).unwrap();
            let read = read_mot(&folder.join("gt/walk/gt/gt.txt")).unwrap();
            fs::remove_dir_all(folder).unwrap();
            for (frame, people) in people.iter().enumerate() {
                let read = read.get(&(frame as u64)).map_or(&[][..], Vec::as_slice);
                let read: Vec<_> = read.iter().map(|one| (one.id, one.bounds, one.unhidden)).collect();
                let written: Vec<_> = people.iter().map(|one| (one.id, one.bounds, one.visible)).collect();
                prop_assert_eq!(read, written);
            }
        }
    }
}
