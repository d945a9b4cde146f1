// SPDX-License-Identifier: MPL-2.0

//! What the tests share: small quick cameras and an HTTP client.
#![allow(clippy::unwrap_used, clippy::expect_used)]
#![allow(dead_code)]

use std::time::Duration;

use reqwest::Client;
use virtual_camera::{Settings, SyntheticSettings, Video, VirtualCamera, World};

/// Longer than anything takes here, however busy the machine.
pub const PATIENCE: Duration = Duration::from_secs(120);

/// A camera with small pictures of a small world.
pub fn settings() -> Settings {
    Settings {
        video: Video { size: Some((160, 120)), frame_rate: Some(25.0), ..Video::default() },
        world: World::Synthetic(SyntheticSettings { size: (512, 384), ..SyntheticSettings::default() }),
        ..Settings::default()
    }
}

pub fn client() -> Client {
    // Two tests of one process may come here; the provider is the same.
    let _ = rustls::crypto::ring::default_provider().install_default();
    Client::builder().no_proxy().timeout(PATIENCE).build().unwrap()
}

/// Status and text of a GET.
pub async fn get(client: &Client, camera: &VirtualCamera, path: &str) -> (u16, String) {
    let response = client.get(format!("{}{path}", camera.url())).send().await.unwrap();
    (response.status().as_u16(), response.text().await.unwrap())
}
