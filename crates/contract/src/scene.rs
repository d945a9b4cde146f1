// SPDX-License-Identifier: MPL-2.0

use crate::codec::{self, Reader};
use crate::{BufferMeta, ContractError, Homography};

/// How the picture of a static world moved from one picture to the next because the camera did.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct CameraMotion {
    /// From a place in the earlier picture to its place in this one, both normalised.
    pub homography: Homography,
    /// Covariance of the displacement at the middle of the frame: xx, xy, yy in frame widths and heights.
    pub covariance: [f64; 3],
    /// Points of the background that agree on it.
    pub inliers: u32,
}

impl CameraMotion {
    const NAME: &'static str = "camera-motion";

    fn to_structure(self) -> gst::Structure {
        gst::Structure::builder(Self::NAME)
            .field("homography", codec::flat(self.homography.0))
            .field("covariance", codec::flat([self.covariance]))
            .field("inliers", self.inliers)
            .build()
    }

    fn from_structure(structure: &gst::StructureRef) -> Result<Self, ContractError> {
        let reader = Reader::new(structure, Self::NAME)?;
        Ok(Self {
            homography: homography(reader.numbers("homography")?),
            covariance: reader.numbers("covariance")?,
            inliers: reader.get("inliers")?,
        })
    }
}

fn homography([a, b, c, d, e, f, g, h, i]: [f64; 9]) -> Homography {
    Homography([[a, b, c], [d, e, f], [g, h, i]])
}

/// One plane of a reduced picture, a byte a pixel, rows packed. Copies share the pixels.
#[derive(Debug, Clone, PartialEq)]
pub struct Plane {
    /// Pixels a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// `width` times `height` pixels.
    pub pixels: glib::Bytes,
}

impl Plane {
    const NAME: &'static str = "plane";

    fn to_structure(&self) -> gst::Structure {
        gst::Structure::builder(Self::NAME)
            .field("width", self.width)
            .field("height", self.height)
            .field("pixels", &self.pixels)
            .build()
    }

    fn from_structure(structure: &gst::StructureRef) -> Result<Self, ContractError> {
        let reader = Reader::new(structure, Self::NAME)?;
        let (width, height): (u32, u32) = (reader.get("width")?, reader.get("height")?);
        let pixels: glib::Bytes = reader.get("pixels")?;
        if pixels.len() as u64 != u64::from(width) * u64::from(height) {
            return Err(reader.value_error("pixels", format!("{} bytes", pixels.len())));
        }
        Ok(Self { width, height, pixels })
    }
}

/// What the detector worked out of one picture and others can use: all planes are of one size, the whole
/// frame reduced.
#[derive(Debug, Clone, PartialEq)]
pub struct SceneMeta {
    /// Timestamp of the picture that the camera's motion starts from. Where it is not that of the picture
    /// before, pictures were dropped in between.
    pub from_pts: Option<gst::ClockTime>,
    /// How the camera moved since; `None` where that is not known (first picture, cut, nothing to hold on to).
    pub camera_motion: Option<CameraMotion>,
    /// How it is taken to have moved since where that was not seen for a moment: as it did before. The motion of the next picture starts
    /// from there. From a place in the earlier picture to its place in this one, both normalised.
    pub coasted_motion: Option<Homography>,
    /// The picture's luma.
    pub luma: Plane,
    /// The picture's chroma, U and V (B−Y and R−Y, 128 for grey); `None` where it has no colour.
    pub chroma: Option<[Plane; 2]>,
    /// How likely each pixel is foreground: 0 (background) to 255.
    pub foreground: Plane,
    /// Mean luma of the background, where this picture shows it.
    pub background: Plane,
}

impl SceneMeta {
    fn plane(reader: &Reader, field: &str) -> Result<Plane, ContractError> {
        Plane::from_structure(reader.get(field)?)
    }

    fn plane_optional(reader: &Reader, field: &str) -> Result<Option<Plane>, ContractError> {
        reader.get_optional(field)?.map(Plane::from_structure).transpose()
    }
}

impl BufferMeta for SceneMeta {
    const NAME: &'static str = "PtzSceneMeta";

    fn write(&self, structure: &mut gst::StructureRef) {
        if let Some(pts) = self.from_pts {
            structure.set("from-pts", pts);
        }
        if let Some(motion) = self.camera_motion {
            structure.set("camera-motion", motion.to_structure());
        }
        if let Some(motion) = self.coasted_motion {
            structure.set("coasted-motion", codec::flat(motion.0));
        }
        structure.set("luma", self.luma.to_structure());
        if let Some([u, v]) = &self.chroma {
            structure.set("u", u.to_structure());
            structure.set("v", v.to_structure());
        }
        structure.set("foreground", self.foreground.to_structure());
        structure.set("background", self.background.to_structure());
    }

    fn read(structure: &gst::StructureRef) -> Result<Self, ContractError> {
        let reader = Reader::new(structure, Self::NAME)?;
        let scene = Self {
            from_pts: reader.get_optional("from-pts")?,
            camera_motion: reader
                .get_optional("camera-motion")?
                .map(CameraMotion::from_structure)
                .transpose()?,
            coasted_motion: reader.numbers_optional("coasted-motion")?.map(homography),
            luma: Self::plane(&reader, "luma")?,
            chroma: Self::plane_optional(&reader, "u")?
                .zip(Self::plane_optional(&reader, "v")?)
                .map(|(u, v)| [u, v]),
            foreground: Self::plane(&reader, "foreground")?,
            background: Self::plane(&reader, "background")?,
        };
        let size = |plane: &Plane| (plane.width, plane.height);
        let chroma = scene.chroma.iter().flatten();
        for plane in [&scene.foreground, &scene.background].into_iter().chain(chroma) {
            if size(plane) != size(&scene.luma) {
                return Err(
                    reader.value_error("luma", format!("{:?} beside {:?}", size(&scene.luma), size(plane)))
                );
            }
        }
        Ok(scene)
    }
}
