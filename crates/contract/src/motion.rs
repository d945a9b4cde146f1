// SPDX-License-Identifier: MPL-2.0

use gst::prelude::*;

use crate::codec::{self, Reader};
use crate::{BufferMeta, ContractError, Point, Rect};

/// `roi-type` of the standard region-of-interest meta that marks moving regions.
pub const MOTION_ROI: &str = "motion";

/// One connected moving region.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Region {
    /// Its bounding box.
    pub bounds: Rect,
    /// Its outer contour, a closed polygon.
    pub contour: Vec<Point>,
    /// Length of the contour as a fraction of the frame's own perimeter.
    pub perimeter: f64,
    /// Area inside the contour as a fraction of the frame's area.
    pub area: f64,
    /// Centre of mass of the area inside the contour.
    pub centroid: Point,
}

impl Region {
    const NAME: &'static str = "region";

    fn to_structure(&self) -> gst::Structure {
        gst::Structure::builder(Self::NAME)
            .field("box", codec::rect(self.bounds))
            .field("contour", codec::flat(self.contour.iter().map(|p| [p.x, p.y])))
            .field("perimeter", self.perimeter)
            .field("area", self.area)
            .field("centroid", codec::point(self.centroid))
            .build()
    }

    fn refill(&mut self, structure: &gst::StructureRef) -> Result<(), ContractError> {
        let reader = Reader::new(structure, Self::NAME)?;
        let mut contour = std::mem::take(&mut self.contour);
        contour.clear();
        reader.each_tuple("contour", |[x, y]| contour.push(Point { x, y }))?;
        *self = Self {
            bounds: reader.rect("box")?,
            contour,
            perimeter: reader.number("perimeter")?,
            area: reader.number("area")?,
            centroid: reader.point("centroid")?,
        };
        Ok(())
    }
}

/// What the detector saw in one frame; absent while it sleeps or learns.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct MotionMeta {
    /// The moving regions, longest perimeter first. Empty: it looked and nothing moved.
    pub regions: Vec<Region>,
    /// Those outside of the detector's zones: nobody is chosen there, but who is followed may go there.
    pub outside: Vec<Region>,
}

const REGIONS: &str = "regions";
const OUTSIDE: &str = "outside";

impl BufferMeta for MotionMeta {
    const NAME: &'static str = "PtzMotionMeta";

    fn write(&self, structure: &mut gst::StructureRef) {
        for (field, regions) in [(REGIONS, &self.regions), (OUTSIDE, &self.outside)] {
            let regions = regions.iter().map(|region| region.to_structure().to_send_value());
            structure.set(field, gst::Array::new(regions));
        }
    }

    fn read(structure: &gst::StructureRef) -> Result<Self, ContractError> {
        let mut meta = Self::default();
        meta.read_in_place(structure)?;
        Ok(meta)
    }
}

impl MotionMeta {
    /// As [`BufferMeta::of`], in the memory of this one; after an error it holds anything.
    pub fn refill(&mut self, buffer: &gst::BufferRef) -> Option<Result<(), ContractError>> {
        let meta = gst::meta::CustomMeta::from_buffer(buffer, Self::NAME).ok()?;
        Some(self.read_in_place(meta.structure()))
    }

    fn read_in_place(&mut self, structure: &gst::StructureRef) -> Result<(), ContractError> {
        let reader = Reader::new(structure, Self::NAME)?;
        for (field, regions) in [(REGIONS, &mut self.regions), (OUTSIDE, &mut self.outside)] {
            let structures = reader.structures(field)?;
            regions.resize_with(structures.len(), Region::default);
            for (region, structure) in regions.iter_mut().zip(structures) {
                region.refill(structure?)?;
            }
        }
        Ok(())
    }
}
