// SPDX-License-Identifier: MPL-2.0

//! MJPEG over HTTP, into an `appsrc`.

use std::sync::mpsc::{SyncSender, sync_channel};

use session::http::{ClientSettings, HttpClient, Stream};

use super::{Failure, LONGEST_START, Video};

/// Opens the stream, reports that, and carries it to the `appsrc` that is handed over, until either ends.
pub async fn carry(settings: ClientSettings, target: &str, report: &SyncSender<Result<Video, Failure>>) {
    let mut stream = match open(settings, target).await {
        Ok(stream) => stream,
        // Who waited for it may have given up.
        Err(failure) => return drop(report.try_send(Err(failure))),
    };
    let (hand_over, handed_over) = sync_channel(1);
    if report.try_send(Ok(Video::Http(hand_over))).is_err() {
        return;
    }
    // A thread of its own: nothing else waits in it.
    let Ok(source) = handed_over.recv() else { return };
    loop {
        match stream.next().await {
            // Where the pipeline is over, or cannot take more for now, so is or does this.
            Ok(Some(bytes)) => {
                if source.push_buffer(gst::Buffer::from_slice(bytes)).is_err() {
                    return;
                }
            }
            Ok(None) => {
                // Where the pipeline is over already, it needs no end.
                let _ = source.end_of_stream();
                return;
            }
            Err(err) => return gst::element_error!(source, gst::ResourceError::Read, ("{err}")),
        }
    }
}

async fn open(settings: ClientSettings, target: &str) -> Result<Stream, Failure> {
    let location = settings.location.clone();
    let opened = async { HttpClient::in_place_of(settings.into())?.open(target, LONGEST_START).await };
    opened.await.map_err(|err| {
        let failure = Failure::from(err);
        Failure { reason: format!("{location}: {}", failure.reason), ..failure }
    })
}
