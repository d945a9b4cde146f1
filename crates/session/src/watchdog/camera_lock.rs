// SPDX-License-Identifier: MPL-2.0

use std::ffi::OsString;
use std::os::unix::ffi::OsStringExt;
use std::path::PathBuf;
use std::time::Duration;

use sha2::{Digest, Sha256};
use tokio::io::AsyncReadExt;
use tokio::net::{UnixListener, UnixStream};
use tokio::time::timeout;

use crate::http::ClientSettings;

/// Says which watchdog of this user sees to a camera: the one of the application that moved it last. An application that
/// was restarted must not have its moves ended by the watchdog of the one before.
///
/// A listening socket in the abstract namespace, named after the camera: it vanishes with its process, and who connects
/// to it takes the camera over.
#[derive(Debug)]
pub struct CameraLock {
    /// `None` where it could not be had: the camera is seen to all the same.
    listener: Option<UnixListener>,
}

/// Somebody who waits to have the lock: let go of the lock first.
#[derive(Debug)]
pub struct Successor {
    _waiting: UnixStream,
}

impl CameraLock {
    /// A holder that does not let go in this time hangs.
    const PATIENCE: Duration = Duration::from_millis(300);

    /// A name in the abstract namespace holds 107 bytes.
    const LONGEST_NAME: usize = 100;

    /// Takes it, from whoever has it.
    pub async fn take(camera: &ClientSettings) -> Self {
        let path = name(camera);
        for _ in 0..3 {
            if let Ok(listener) = UnixListener::bind(&path) {
                return Self { listener: Some(listener) };
            }
            // Where nobody listens any more, it is free.
            if let Ok(mut holder) = UnixStream::connect(&path).await {
                // It says nothing; it closes when the lock is free.
                let _ = timeout(Self::PATIENCE, holder.read_u8()).await;
            }
        }
        Self { listener: None }
    }

    /// Resolves when somebody else of the same user, or root, takes it.
    pub async fn taken(&self) -> Successor {
        let Some(listener) = &self.listener else { return std::future::pending().await };
        loop {
            // SAFETY: has no preconditions.
            let own = unsafe { libc::geteuid() };
            match listener.accept().await {
                Ok((waiting, _)) if waiting.peer_cred().is_ok_and(|peer| [own, 0].contains(&peer.uid())) => {
                    return Successor { _waiting: waiting };
                }
                Ok(_) => {}
                // Out of file descriptors, for instance: there may be some later.
                Err(_) => tokio::time::sleep(Self::PATIENCE).await,
            }
        }
    }
}

fn name(camera: &ClientSettings) -> PathBuf {
    // SAFETY: has no preconditions.
    let user = unsafe { libc::geteuid() };
    let owner = format!("\0ptztrack-watchdog {user} ");
    let mut name = format!("{} {}", camera.channel, camera.location);
    // Cut, two cameras could have one name.
    if owner.len() + name.len() > CameraLock::LONGEST_NAME {
        name = format!("{:x}", Sha256::digest(name));
    }
    PathBuf::from(OsString::from_vec((owner + &name).into_bytes()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::client_settings;

    fn camera(host: &str) -> ClientSettings {
        // Other tests, of other processes too, have other cameras.
        let location = format!("http://{host}-{}.test", std::process::id());
        ClientSettings { channel: "1".to_owned(), ..client_settings(&location) }
    }

    #[tokio::test]
    async fn the_next_takes_it_and_has_it_when_the_one_before_lets_go() {
        let camera = camera("taken");
        let first = CameraLock::take(&camera).await;
        let second = tokio::spawn({
            let camera = camera.clone();
            async move { CameraLock::take(&camera).await }
        });
        let successor = first.taken().await;
        assert!(!second.is_finished());
        drop(first);
        drop(successor);
        let second = second.await.unwrap();
        assert!(second.listener.is_some());
        drop(second);
        assert!(CameraLock::take(&camera).await.listener.is_some());
    }

    #[tokio::test]
    async fn one_camera_is_no_other() {
        let (one, other) = (camera("one"), camera("other"));
        let second_channel = ClientSettings { channel: "2".to_owned(), ..one.clone() };
        let [long, as_long] = ["a", "b"].map(|end| camera(&("a".repeat(60) + "." + &"a".repeat(60) + end)));
        let mut locks = Vec::new();
        for camera in [one, other, second_channel, long, as_long] {
            let lock = CameraLock::take(&camera).await;
            assert!(lock.listener.is_some());
            locks.push(lock);
        }
    }

    #[tokio::test]
    async fn a_holder_that_hangs_delays_nobody_for_long() {
        let camera = camera("hanging");
        let _holder = CameraLock::take(&camera).await;
        assert!(CameraLock::take(&camera).await.listener.is_none());
    }
}
