//! Stands in until the virtual camera tells the truth itself.

/// A box in pixels of the view; may lie outside of it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bounds {
    /// Left edge.
    pub left: f64,
    /// Top edge.
    pub top: f64,
    /// Pixels.
    pub width: f64,
    /// Pixels.
    pub height: f64,
}

/// One person as they are in a picture of the view.
#[derive(Debug, Clone, PartialEq)]
pub struct GroundTruth {
    /// Number of the person.
    pub id: u32,
    /// Whole body, hidden parts included.
    pub bounds: Bounds,
    /// Of the whole body's silhouette, pixels.
    pub centroid: (f64, f64),
    /// Part of the silhouette that is inside the view and hidden by nothing.
    pub visible: f64,
    /// Part hidden by nothing, wherever it is.
    pub unhidden: f64,
    /// Part inside the view, hidden or not.
    pub in_view: f64,
    /// Feet, world metres.
    pub position_m: Option<[f64; 3]>,
    /// Pan and tilt of the centroid as seen from the camera, degrees.
    pub direction_deg: Option<(f64, f64)>,
}
