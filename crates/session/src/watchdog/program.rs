// SPDX-License-Identifier: MPL-2.0

use std::ffi::OsString;
use std::io;
use std::os::fd::AsFd;
use std::os::unix::fs::{FileTypeExt, PermissionsExt};
use std::os::unix::net::{UnixListener as StdUnixListener, UnixStream as StdUnixStream};
use std::path::Path;
use std::process::ExitCode;
use std::time::Duration;

use tokio::net::{UnixListener, UnixStream};
use tokio::runtime::{Builder, Runtime};
use tokio::time::sleep;

use super::{Armed, process, serve};
use crate::Client;

/// After no connection could be taken.
const ACCEPT_AGAIN: Duration = Duration::from_millis(200);

/// Whoever ends all processes of a service or container must leave this one until the cameras rest.
static ARMED: Armed = Armed::new(process::ignore_termination);

/// The whole of a watchdog program of this name, which the element of that name starts, with the socket as its standard
/// input; or an administrator, with `--listen SOCKET`, to have it run elsewhere than the application.
pub fn run<C: Client>(program: &str, element: &str) -> ExitCode {
    let arguments: Vec<OsString> = std::env::args_os().skip(1).collect();
    let ended = match &arguments[..] {
        [] if is_socket() => serve_parent::<C>(),
        [option, socket] if option == "--listen" => listen::<C>(Path::new(socket)),
        _ => {
            eprintln!(
                "usage: {program} --listen SOCKET
Stops cameras whose application has died or hangs. `{element}` starts it by itself; by hand it is started only to run
elsewhere than the application, as another user, unit or container, with `dead-man-socket=SOCKET` on {element}."
            );
            return ExitCode::from(2);
        }
    };
    match ended {
        Ok(()) => ExitCode::SUCCESS,
        Err(err) => {
            eprintln!("{program}: {err}");
            ExitCode::FAILURE
        }
    }
}

/// Whether it was started by an application.
fn is_socket() -> bool {
    io::stdin().as_fd().try_clone_to_owned().is_ok_and(|stdin| StdUnixStream::from(stdin).peer_addr().is_ok())
}

fn serve_parent<C: Client>() -> io::Result<()> {
    process::leave_parent()?;
    process::keep_secrets()?;
    let stream = StdUnixStream::from(io::stdin().as_fd().try_clone_to_owned()?);
    stream.set_nonblocking(true)?;
    runtime()?.block_on(async {
        serve::<C>(UnixStream::from_std(stream)?, &ARMED).await;
        Ok(())
    })
}

/// Serves whoever of the same user or group connects, for ever.
fn listen<C: Client>(socket: &Path) -> io::Result<()> {
    process::keep_secrets()?;
    // What a predecessor left; whatever else lies there is not ours to remove.
    let left = socket.symlink_metadata().is_ok_and(|found| found.file_type().is_socket());
    if left && StdUnixStream::connect(socket).is_err() {
        std::fs::remove_file(socket)?;
    }
    let listener = StdUnixListener::bind(socket)?;
    std::fs::set_permissions(socket, std::fs::Permissions::from_mode(0o660))?;
    listener.set_nonblocking(true)?;
    runtime()?.block_on(async {
        let listener = UnixListener::from_std(listener)?;
        loop {
            match listener.accept().await {
                Ok((application, _)) => drop(tokio::spawn(serve::<C>(application, &ARMED))),
                // Out of file descriptors, for instance: there may be some later, and cameras wait for their stop.
                Err(_) => sleep(ACCEPT_AGAIN).await,
            }
        }
    })
}

fn runtime() -> io::Result<Runtime> {
    Builder::new_current_thread().enable_all().build()
}
