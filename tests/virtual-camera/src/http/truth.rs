// SPDX-License-Identifier: MPL-2.0

//! What is really in a picture, for the live page to draw over it.

use std::{sync::Arc, time::Duration};

use axum::{
    extract::{RawQuery, State},
    http::header,
    response::{IntoResponse, Response},
};
use serde::Serialize;

use super::Site;
use crate::{
    camera::Camera,
    truth::{GroundTruth, Mask},
    vapix::{Args, parse_args},
    wish::{PictureError, Wish, argument},
};

#[derive(Serialize)]
struct TruthReply {
    /// Of the picture, in pixels; everything below counts in them.
    size: (u32, u32),
    people: Vec<GroundTruth>,
    /// Where somebody is seen: column, row and length of each run of pixels. Empty where only boxes are known.
    silhouette: Vec<(usize, usize, usize)>,
}

/// The truth about the picture of `resolution` whose exposure began `at` seconds, as JSON; by default about the newest.
pub(super) async fn truth(
    State(site): State<Arc<Site>>,
    RawQuery(query): RawQuery,
) -> Result<Response, PictureError> {
    let args = parse_args(query.unwrap_or_default().as_bytes());
    let size = Wish::parse(&args, &site.camera)?.size;
    let exposure = exposure(&args, &site.camera)?;
    let camera = site.camera.clone();
    let found = tokio::task::spawn_blocking(move || TruthReply {
        size,
        people: camera.people(exposure, size).into_iter().map(|person| person.truth).collect(),
        silhouette: camera.silhouette(exposure, size).map(|mask| runs(&mask)).unwrap_or_default(),
    });
    let json = found.await.ok().and_then(|report| serde_json::to_string(&report).ok()).unwrap_or_default();
    Ok(([(header::CONTENT_TYPE, "application/json")], json).into_response())
}

fn exposure(args: &Args, camera: &Camera) -> Result<Duration, PictureError> {
    let seconds = |text: &str| text.parse().ok().and_then(|at| Duration::try_from_secs_f64(at).ok());
    Ok(argument(args, "at", seconds)?.unwrap_or_else(|| camera.newest_exposure()).min(camera.now()))
}

fn runs(mask: &Mask) -> Vec<(usize, usize, usize)> {
    let mut runs = Vec::new();
    for (row, line) in mask.data.chunks_exact(mask.width.max(1)).enumerate() {
        let mut column = 0;
        for run in line.chunk_by(|a, b| a == b) {
            if run[0] != 0 {
                runs.push((column, row, run.len()));
            }
            column += run.len();
        }
    }
    runs
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mask_is_its_runs() {
        let data = [[0, 255, 255, 0], [0; 4], [255; 4], [255, 0, 0, 255]].concat();
        let mask = Mask { width: 4, height: 4, data };
        assert_eq!(runs(&mask), [(1, 0, 2), (0, 2, 4), (0, 3, 1), (3, 3, 1)]);
        assert_eq!(runs(&Mask { width: 0, height: 0, data: Vec::new() }), []);
    }
}
