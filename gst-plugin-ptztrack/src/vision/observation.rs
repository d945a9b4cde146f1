// SPDX-License-Identifier: MPL-2.0

//! What one picture brings to the tracker.

use super::{Luma, SceneView};

/// One picture, and what is known of it before anything is tracked in it.
#[derive(Debug, Clone, Copy)]
pub struct Observation<'a> {
    /// Brightness at full resolution.
    pub luma: Luma<'a>,
    /// What the whole picture shows, reduced; `None` where nobody looked.
    pub scene: Option<SceneView<'a>>,
}

impl<'a> From<Luma<'a>> for Observation<'a> {
    /// A picture of which nothing else is known.
    fn from(luma: Luma<'a>) -> Self {
        Self { luma, scene: None }
    }
}
