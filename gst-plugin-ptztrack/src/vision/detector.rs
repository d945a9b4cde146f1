// SPDX-License-Identifier: MPL-2.0

use std::iter;

use opencv::core::{self, CV_8UC1, Mat, Scalar};
use opencv::prelude::*;
use ptztrack_contract::{Homography, MotionMeta, Region};

use super::background::{Background, ForegroundTest};
use super::bits::Bits;
use super::carried_zones::CarriedZones;
use super::contours::{Grid, fill_regions, find_regions};
use super::ghosts::is_light;
use super::morphology::clean;
use super::persistence::Persistence;
use super::reduce::{divisor, with_reduced};
use super::scene_model::SceneView;
use super::segmentation::Segmentation;
use super::zones::{Zones, zone_mask};
use super::{Luma, LumaError};

/// Width and height of the opening, pixels of the reduced picture: limbs are narrow and upright, noise and the edges of shadows are low.
const AUTO_OPEN: (usize, usize) = (1, 3);
/// The closing's width and height are these parts of the picture's height. Upright, as people are: head,
/// body and legs are joined, neighbours are not.
const AUTO_CLOSE: (usize, usize) = (64, 16);

/// The most that the pictures of [`ForegroundTest::Spread`] may take: 32 of 4K, or 255 of 1280x720.
const MAX_WINDOW_BYTES: usize = 256 << 20;

/// Which regions are reported.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RegionChoice {
    /// The one whose contour is longest (thesis 3.4.1).
    LargestPerimeter,
    /// All of them.
    All,
}

/// What the detector goes by; may change from picture to picture.
#[derive(Debug, Clone, PartialEq)]
pub struct DetectorConfig {
    /// Pictures wider than this many pixels are reduced before they are looked at; 0: never.
    pub analysis_width: usize,
    /// Weight of a new picture in the running mean (thesis 3.1), 0 to 1.
    pub alpha: f64,
    /// What makes a pixel foreground.
    pub test: ForegroundTest,
    /// Side of the opening's square in pixels of the whole picture; `None` chooses an upright rectangle.
    pub open_size: Option<usize>,
    /// Side of the closing's square in pixels of the whole picture; `None` chooses an upright rectangle.
    pub close_size: Option<usize>,
    /// Which regions are reported.
    pub choice: RegionChoice,
    /// Smallest area that counts, as a fraction of the picture.
    pub min_area: f64,
    /// Largest area that counts, as a fraction of the picture.
    pub max_area: f64,
    /// Where to look; everywhere, where there are none.
    pub zones: Zones,
    /// Where not to look.
    pub exclude_zones: Zones,
    /// Pictures from which the background is learned before anything is reported.
    pub warm_up: u32,
    /// A region is reported once it has been seen in this many pictures in a row.
    pub confirm_pictures: u32,
}

/// A picture that could not be looked at.
#[derive(Debug, thiserror::Error)]
pub enum DetectorError {
    /// OpenCV refused.
    #[error(transparent)]
    OpenCv(#[from] opencv::Error),
    /// The reduced picture is not what it should be.
    #[error(transparent)]
    Luma(#[from] LumaError),
    /// More memory than a detector should take.
    #[error(
        "`window`={window} pictures of {width}x{height} are {} MB, more than {} MB: choose a smaller `window`, or smaller pictures",
        (window * width * height) >> 20, MAX_WINDOW_BYTES >> 20
    )]
    Window {
        /// As was asked for.
        window: usize,
        /// Pixels.
        width: usize,
        /// Pixels.
        height: usize,
    },
}

impl RegionChoice {
    /// Of regions sorted by perimeter, the longest first.
    fn of(self, mut regions: Vec<Region>) -> Vec<Region> {
        if self == Self::LargestPerimeter {
            regions.truncate(1);
        }
        regions
    }
}

/// Finds what moves in a still picture: thesis 3.2 to 3.4 in a row.
#[derive(Debug, Default)]
pub struct Detector {
    background: Background,
    persistence: Persistence,
    /// Pictures learned since the last start.
    learned: u32,
    frame: (usize, usize),
    divisor: usize,
    reduced: Mat,
    /// Foreground of the last picture, cleaned; as large as the reduced picture.
    mask: Mat,
    segmentation: Segmentation,
    bits: Bits,
    zones: Option<ZoneCache>,
    /// Where light has changed in the last picture.
    light: Vec<Region>,
    /// Memory: what was told of a picture before, emptied, and regions.
    told: MotionMeta,
    spare: Vec<Region>,
}

/// The mask of zones, drawn once.
#[derive(Debug)]
struct ZoneCache {
    zones: Zones,
    exclude_zones: Zones,
    size: core::Size,
    mask: Option<Mat>,
}

impl Detector {
    /// Forgets the background: the next pictures are learned before anything is reported.
    pub fn relearn(&mut self) {
        self.background.restart();
        self.persistence.restart();
        self.segmentation.restart();
        self.learned = 0;
        self.mask = Mat::default();
    }

    /// Looks at the next picture. Gives the moving regions, longest perimeter first, or `None` while it learns.
    pub fn process(
        &mut self,
        luma: &Luma,
        config: &DetectorConfig,
    ) -> Result<Option<Vec<Region>>, DetectorError> {
        let frame = (luma.width(), luma.height());
        let divisor = divisor(luma.width(), config.analysis_width).min(frame.1.max(1));
        if (self.frame, self.divisor) != (frame, divisor) {
            self.relearn();
            (self.frame, self.divisor) = (frame, divisor);
        }
        if frame.0 == 0 || frame.1 == 0 {
            return Ok(None);
        }
        let mut kept = std::mem::take(&mut self.reduced);
        let found = with_reduced(luma, divisor, &mut kept, |small| self.look(small, config));
        self.reduced = kept;
        found
    }

    /// Looks at a picture of that size (pixels) whose foreground is told from its likelihoods in `scene`. Gives the moving
    /// regions, longest perimeter first, or `None` while the background is learned.
    ///
    /// Who is followed may leave `zones`, so regions outside of them are given apart.
    pub fn process_likelihood(
        &mut self,
        scene: &SceneView,
        frame: (usize, usize),
        config: &DetectorConfig,
        zones: &CarriedZones,
    ) -> Result<Option<MotionMeta>, DetectorError> {
        let foreground = &scene.foreground;
        let divisor = (frame.0 / foreground.width().max(1)).max(1);
        if (self.frame, self.divisor) != (frame, divisor) {
            self.relearn();
            (self.frame, self.divisor) = (frame, divisor);
        }
        if self.learned < config.warm_up.max(1) {
            self.learned += 1;
            self.mask = Mat::default();
            return Ok(None);
        }
        let [open_size, close_size] = self.sizes(config);
        self.fit_mask(foreground.width(), foreground.height())?;
        self.segmentation.segment(scene, open_size, close_size, self.mask.data_bytes_mut()?);
        let MotionMeta { regions: mut found, mut outside } = std::mem::take(&mut self.told);
        self.find_regions(config, &mut found)?;
        self.spare.append(&mut self.light);
        self.light.extend(found.extract_if(.., |region| is_light(scene, region)));
        let motion = scene.camera_motion.map(|motion| motion.homography).or(scene.coasted_motion);
        self.persistence.carry(&motion.unwrap_or(Homography::IDENTITY));
        let mut regions = self.persistence.confirmed(found, config.confirm_pictures);
        outside.extend(regions.extract_if(.., |region| !zones.allow(region.centroid)));
        Ok(Some(MotionMeta { regions: config.choice.of(regions), outside }))
    }

    /// Regions of the last picture in which nobody is: light has changed there.
    pub fn light(&self) -> &[Region] {
        &self.light
    }

    /// Takes back what it told, as memory for the next picture.
    pub fn recycle(&mut self, mut motion: MotionMeta) {
        self.spare.append(&mut motion.regions);
        self.spare.append(&mut motion.outside);
        self.told = motion;
    }

    /// The same of the reduced picture.
    fn look(&mut self, luma: &Luma, config: &DetectorConfig) -> Result<Option<Vec<Region>>, DetectorError> {
        self.subtract(luma, config)?;
        if self.learned < config.warm_up.max(1) {
            self.learned += 1;
            self.mask = Mat::default();
            return Ok(None);
        }
        self.find(config).map(Some)
    }

    /// Updates the background; leaves the foreground in `mask`.
    fn subtract(&mut self, luma: &Luma, config: &DetectorConfig) -> Result<(), DetectorError> {
        let (width, height) = (luma.width(), luma.height());
        if let ForegroundTest::Spread { window, .. } = config.test
            && window * width * height > MAX_WINDOW_BYTES
        {
            return Err(DetectorError::Window { window, width, height });
        }
        self.fit_mask(width, height)?;
        // While it learns, the mean is the plain average of all pictures.
        let average = if self.learned < config.warm_up { 1.0 / f64::from(self.learned + 1) } else { 0.0 };
        let weight = config.alpha.max(average);
        self.background.update(luma, weight, config.test, self.mask.data_bytes_mut()?);
        Ok(())
    }

    /// Sees to it that `mask` has that size.
    fn fit_mask(&mut self, width: usize, height: usize) -> opencv::Result<()> {
        let (rows, columns) = (height as i32, width as i32);
        if (self.mask.rows(), self.mask.cols()) != (rows, columns) {
            self.mask = Mat::new_rows_cols_with_default(rows, columns, CV_8UC1, Scalar::all(0.0))?;
        }
        Ok(())
    }

    /// The regions of the foreground in `mask`.
    fn find(&mut self, config: &DetectorConfig) -> Result<Vec<Region>, DetectorError> {
        self.look_in_zones(config)?;
        let [open_size, close_size] = self.sizes(config);
        let width = self.mask.cols() as usize;
        clean(self.mask.data_bytes_mut()?, width, open_size, close_size, &mut self.bits);
        let mut found = Vec::new();
        self.find_regions(config, &mut found)?;
        Ok(self.chosen(found, config))
    }

    /// Leaves the regions of `mask` that are neither too small nor too large in `found`, longest perimeter first.
    fn find_regions(
        &mut self,
        config: &DetectorConfig,
        found: &mut Vec<Region>,
    ) -> Result<(), DetectorError> {
        find_regions(&self.mask, self.grid(), found, &mut self.spare)?;
        let areas = config.min_area..=config.max_area;
        self.spare.extend(found.extract_if(.., |region| !areas.contains(&region.area)));
        Ok(())
    }

    /// Those that are reported.
    fn chosen(&mut self, found: Vec<Region>, config: &DetectorConfig) -> Vec<Region> {
        config.choice.of(self.persistence.confirmed(found, config.confirm_pictures))
    }

    fn look_in_zones(&mut self, config: &DetectorConfig) -> opencv::Result<()> {
        let size = self.mask.size()?;
        let fits = |cache: &ZoneCache| {
            cache.size == size && cache.zones == config.zones && cache.exclude_zones == config.exclude_zones
        };
        let cache = match self.zones.take().filter(fits) {
            Some(cache) => cache,
            None => ZoneCache {
                zones: config.zones.clone(),
                exclude_zones: config.exclude_zones.clone(),
                size,
                mask: zone_mask(
                    &config.zones,
                    &config.exclude_zones,
                    size.width as usize,
                    size.height as usize,
                )?,
            },
        };
        if let Some(zone) = &cache.mask {
            let mut inside = Mat::default();
            core::bitwise_and_def(&self.mask, zone, &mut inside)?;
            self.mask = inside;
        }
        self.zones = Some(cache);
        Ok(())
    }

    /// Width and height of the opening and of the closing, in pixels of the mask.
    fn sizes(&self, config: &DetectorConfig) -> [(usize, usize); 2] {
        let reduced = |size: usize| (size + self.divisor / 2) / self.divisor;
        let height = self.frame.1 / self.divisor;
        let upright = ((height / AUTO_CLOSE.0).max(3), (height / AUTO_CLOSE.1).max(3));
        let chosen = |size: Option<usize>, auto| size.map(reduced).map_or(auto, |side| (side, side));
        [chosen(config.open_size, AUTO_OPEN), chosen(config.close_size, upright)]
    }

    fn grid(&self) -> Grid {
        let in_mask = |size: usize| size as f64 / self.divisor as f64;
        Grid { width: in_mask(self.frame.0), height: in_mask(self.frame.1) }
    }

    /// What it took for foreground in the last picture, cleaned, in the size of the frame: each row of
    /// `out` is `stride` bytes, and every `step`th of them is set, 255 for foreground, 0 for background.
    pub fn draw_mask(&self, out: &mut [u8], stride: usize, step: usize) -> opencv::Result<()> {
        self.enlarge(&self.mask, out, stride, step)
    }

    /// The same of what `regions`, found in the last picture, enclose.
    pub fn draw_regions(
        &self,
        regions: &[Region],
        out: &mut [u8],
        stride: usize,
        step: usize,
    ) -> opencv::Result<()> {
        let mut filled = self.mask.try_clone()?;
        fill_regions(&mut filled, regions, self.grid())?;
        self.enlarge(&filled, out, stride, step)
    }

    fn enlarge(&self, mask: &Mat, out: &mut [u8], stride: usize, step: usize) -> opencv::Result<()> {
        let (divisor, columns) = (self.divisor.max(1), mask.cols().max(1) as usize);
        let pixels = if mask.empty() { &[] } else { mask.data_bytes()? };
        let mut rows = pixels.chunks_exact(columns);
        for lines in out.chunks_mut(stride * divisor) {
            let row = rows.next().unwrap_or(&[]);
            for line in lines.chunks_mut(stride) {
                let enlarged = row.iter().flat_map(|pixel| iter::repeat_n(*pixel, divisor));
                let slots = line.iter_mut().step_by(step);
                slots.zip(enlarged.chain(iter::repeat(0))).for_each(|(slot, pixel)| *slot = pixel);
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests;
