//! RTSP, through gst-rtsp-server.

use std::{net::SocketAddr, sync::Arc};

use crate::{Error, camera::Camera};

/// The running server.
pub(crate) struct RtspServer {
    address: SocketAddr,
}

impl RtspServer {
    pub fn start(_camera: Arc<Camera>) -> Result<Self, Error> {
        Ok(Self { address: SocketAddr::from(([127, 0, 0, 1], 0)) })
    }

    pub fn address(&self) -> SocketAddr {
        self.address
    }

    pub fn stop(&mut self) {}
}
