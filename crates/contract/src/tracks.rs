// SPDX-License-Identifier: MPL-2.0

use gst::prelude::*;

use crate::codec::{self, Reader};
use crate::messages::Times;
use crate::named::named_enum;
use crate::{BufferMeta, ContractError, Rect, Vector};

named_enum! {
    /// How a track is seen in one frame.
    TrackState {
        /// In a region of its own.
        Seen = "seen",
        /// In a region with others.
        Shared = "shared",
        /// Not at all: its place is predicted.
        Hidden = "hidden",
    }
}

/// Somebody who is seen, or was a moment ago.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Track {
    /// Number, counted from 1 by each tracker. Whoever comes back within the tracker's `memory-time` has their old one.
    pub id: u64,
    /// Bounding box; predicted where it is hidden.
    pub bounds: Rect,
    /// Motion against the background, frames per second of time: the camera's own motion is taken off.
    pub velocity: Vector,
    /// How it is seen.
    pub state: TrackState,
    /// How likely there is somebody: 0 to 1.
    pub confidence: f64,
    /// Whether it is the target.
    pub is_target: bool,
}

impl Track {
    const NAME: &'static str = "track";

    fn write(&self, structure: &mut gst::StructureRef) {
        structure.set("id", self.id);
        structure.set("box", codec::rect(self.bounds));
        structure.set("velocity", codec::vector(self.velocity));
        structure.set("state", self.state.name());
        structure.set("confidence", self.confidence);
        structure.set("target", self.is_target);
    }

    fn read(reader: &Reader) -> Result<Self, ContractError> {
        Ok(Self {
            id: reader.get("id")?,
            bounds: reader.rect("box")?,
            velocity: reader.vector("velocity")?,
            state: reader.named("state")?,
            confidence: reader.number("confidence")?,
            is_target: reader.get("target")?,
        })
    }
}

/// Everybody whom the tracker follows in one frame.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct TracksMeta {
    /// In no particular order; at most one of them is the target.
    pub tracks: Vec<Track>,
}

const TRACKS: &str = "tracks";

impl BufferMeta for TracksMeta {
    const NAME: &'static str = "PtzTracksMeta";

    fn write(&self, structure: &mut gst::StructureRef) {
        let tracks = self.tracks.iter().map(|track| {
            let mut structure = gst::Structure::new_empty(Track::NAME);
            track.write(&mut structure);
            structure.to_send_value()
        });
        structure.set(TRACKS, gst::Array::new(tracks));
    }

    fn read(structure: &gst::StructureRef) -> Result<Self, ContractError> {
        let reader = Reader::new(structure, Self::NAME)?;
        let read = |structure: Result<_, _>| Track::read(&Reader::new(structure?, Track::NAME)?);
        let tracks = reader.structures(TRACKS)?.map(read).collect::<Result<_, _>>()?;
        Ok(Self { tracks })
    }
}

named_enum! {
    /// What happened to a track.
    TrackChange {
        /// There is somebody new.
        New = "new",
        /// Somebody who was here before is back under their old number.
        Back = "back",
        /// It turned out to be a part of another track, and goes on under that one's number.
        Merged = "merged",
        /// Nobody is there any more.
        Gone = "gone",
    }
}

/// Posted by the tracker for each track that comes or goes, where `post-tracks` asks for it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TrackMessage {
    /// What happened.
    pub change: TrackChange,
    /// When.
    pub times: Times,
    /// Number of the track.
    pub id: u64,
    /// Number of the track that it went into, where it merged.
    pub into: Option<u64>,
}

impl TrackMessage {
    const NAME: &'static str = "ptztrack-track";

    /// Its `GstStructure` form, for an element message.
    pub fn to_structure(&self) -> gst::Structure {
        let mut structure = gst::Structure::new_empty(Self::NAME);
        structure.set("change", self.change.name());
        self.times.write(&mut structure);
        structure.set("id", self.id);
        if let Some(into) = self.into {
            structure.set("into", into);
        }
        structure
    }

    /// Reads the structure of an element message.
    pub fn from_structure(structure: &gst::StructureRef) -> Result<Self, ContractError> {
        let reader = Reader::new(structure, Self::NAME)?;
        Ok(Self {
            change: reader.named("change")?,
            times: Times::read(&reader)?,
            id: reader.get("id")?,
            into: reader.get_optional("into")?,
        })
    }
}
