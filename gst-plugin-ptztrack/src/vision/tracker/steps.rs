//! Which steps the tracker takes: those of the thesis alone, or all.

/// A choice of steps.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Profile {
    /// Thesis 3.5 as written: corners, optical flow, mean of the points, mean-shift.
    Thesis,
    /// With ego-motion, forward-backward test, appearance, replenished points and coasting.
    #[default]
    Robust,
}

/// The steps of a profile and their limits.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Steps {
    /// Standard deviations that a first corner may lie from the mean of all.
    pub deviation_range: f32,
    /// Grey levels of mean absolute difference from which a point is lost.
    pub max_residual: f32,
    /// Pixels a point may be off after going forth and back; `None`: not tested.
    pub max_return_error: Option<f32>,
    /// Whether the motion of the background is measured.
    pub ego_motion: bool,
    /// Whether points must agree on the motion to stay.
    pub consensus: bool,
    /// Whether the look of the whole target has a say, and a hidden target is looked for.
    pub appearance: bool,
    /// Whether new points take the place of lost ones.
    pub replenish: bool,
    /// Whether greys that the street has too count less in the back-projection.
    pub background_weighted: bool,
    /// How far the centre of mass may lie from the middle of the box, as a share of its sides.
    pub centroid_reach: f32,
    /// Whether the box is centred on its points, from where the mean-shift starts.
    pub recentre: bool,
}

impl Profile {
    pub(super) fn steps(self) -> Steps {
        match self {
            Self::Thesis => Steps {
                // "A 20% range from the standard deviation."
                deviation_range: 1.2,
                max_residual: 20.0,
                max_return_error: None,
                ego_motion: false,
                consensus: false,
                appearance: false,
                replenish: false,
                background_weighted: false,
                centroid_reach: 0.5,
                recentre: true,
            },
            Self::Robust => Steps {
                // Head and feet lie beyond 1.2 deviations, and they are good points.
                deviation_range: 2.0,
                max_residual: 25.0,
                max_return_error: Some(0.8),
                ego_motion: true,
                consensus: true,
                appearance: true,
                replenish: true,
                background_weighted: true,
                centroid_reach: 0.1,
                recentre: false,
            },
        }
    }
}
