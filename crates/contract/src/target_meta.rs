// SPDX-License-Identifier: MPL-2.0

use crate::codec::{self, Reader};
use crate::{BufferMeta, ContractError, Point, Rect, TargetState, Vector};

/// A feature point of the frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Feature {
    /// Where it is in this frame.
    pub position: Point,
    /// Whether it is followed on the target (thesis figure 3.7, green) or was rejected (red).
    pub kept: bool,
}

/// What the tracker knows of its target in one frame.
#[derive(Debug, Clone, PartialEq)]
pub struct TargetMeta {
    /// What the tracker is doing. In [`TargetState::Searching`] the geometry below says nothing.
    pub state: TargetState,
    /// Number of the target, counted from 1 by each tracker; 0 where there is none.
    pub id: u64,
    /// Bounding box; predicted while occluded.
    pub bounds: Rect,
    /// Whether that holds several people who are followed together (`selection=group`), and not only who has the number.
    pub is_group: bool,
    /// Centre of mass (thesis 3.15); predicted while occluded.
    pub centroid: Point,
    /// Motion of the target in the picture, frames per second of time: camera motion included.
    pub velocity: Vector,
    /// Motion of the background in the picture, same unit; `None` where it could not be seen.
    pub ego_velocity: Option<Vector>,
    /// How fast the background grows as the camera zooms in: the logarithm of its magnification, per second of time; `None` where it
    /// could not be seen.
    pub ego_zoom: Option<f64>,
    /// For how long the picture has shown the same, camera and people at rest alike; `None` where nobody looked.
    pub unchanged_for: Option<gst::ClockTime>,
    /// 0 (a guess) to 1 (certain).
    pub confidence: f64,
    /// The feature points.
    pub features: Vec<Feature>,
    /// Width by height, as displayed, of the picture in which all this was found; `None` where that is not told. Scaling
    /// leaves it as it is; where it is another, the picture was cropped or got borders, and nothing here is where it says.
    pub aspect: Option<f64>,
    /// Running time at which the picture was captured, as far as its timestamp tells.
    pub capture_time: Option<gst::ClockTime>,
}

impl Default for TargetMeta {
    fn default() -> Self {
        Self {
            state: TargetState::Searching,
            id: 0,
            bounds: Rect::default(),
            is_group: false,
            centroid: Point::default(),
            velocity: Vector::default(),
            ego_velocity: None,
            ego_zoom: None,
            unchanged_for: None,
            confidence: 0.0,
            features: Vec::new(),
            aspect: None,
            capture_time: None,
        }
    }
}

impl BufferMeta for TargetMeta {
    const NAME: &'static str = "PtzTargetMeta";

    fn write(&self, structure: &mut gst::StructureRef) {
        structure.set("state", self.state.name());
        structure.set("id", self.id);
        structure.set("box", codec::rect(self.bounds));
        if self.is_group {
            structure.set("group", true);
        }
        structure.set("centroid", codec::point(self.centroid));
        structure.set("velocity", codec::vector(self.velocity));
        if let Some(ego) = self.ego_velocity {
            structure.set("ego-velocity", codec::vector(ego));
        }
        if let Some(zoom) = self.ego_zoom {
            structure.set("ego-zoom", zoom);
        }
        if let Some(time) = self.unchanged_for {
            structure.set("unchanged-for", time);
        }
        structure.set("confidence", self.confidence);
        let features = self.features.iter().map(|feature| {
            let kept = if feature.kept { 1.0 } else { 0.0 };
            [feature.position.x, feature.position.y, kept]
        });
        structure.set("features", codec::flat(features));
        if let Some(aspect) = self.aspect {
            structure.set("aspect", aspect);
        }
        if let Some(time) = self.capture_time {
            structure.set("capture-time", time);
        }
    }

    fn read(structure: &gst::StructureRef) -> Result<Self, ContractError> {
        let reader = Reader::new(structure, Self::NAME)?;
        let features = reader
            .tuples::<3>("features")?
            .into_iter()
            .map(|[x, y, kept]| Feature { position: Point { x, y }, kept: kept > 0.5 });
        Ok(Self {
            state: reader.named("state")?,
            id: reader.get("id")?,
            bounds: reader.rect("box")?,
            is_group: reader.get_optional("group")?.unwrap_or(false),
            centroid: reader.point("centroid")?,
            velocity: reader.vector("velocity")?,
            ego_velocity: reader.vector_optional("ego-velocity")?,
            ego_zoom: reader.number_optional("ego-zoom")?,
            unchanged_for: reader.get_optional("unchanged-for")?,
            confidence: reader.number("confidence")?,
            features: features.collect(),
            aspect: reader.number_optional("aspect")?,
            capture_time: reader.get_optional("capture-time")?,
        })
    }
}
