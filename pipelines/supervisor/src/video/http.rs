// SPDX-License-Identifier: MPL-2.0

//! MJPEG over HTTP, into an `appsrc`.

use std::iter::successors;
use std::sync::mpsc::{SyncSender, sync_channel};

use gst::prelude::*;
use gst_app::AppSrc;
use session::http::{ClientSettings, HttpClient, Stream};

use super::multipart::Multipart;
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
    let mut parts = is_taken_apart(&source).then(Multipart::default);
    loop {
        match next(&mut stream, parts.as_mut()).await {
            // Nothing of a picture; where the pipeline is over, nobody else would notice.
            Ok(Some(buffer)) if buffer.size() == 0 => {
                if is_over(&source) {
                    return;
                }
            }
            // Where the pipeline is over, or cannot take more for now, so is or does this.
            Ok(Some(buffer)) => {
                if source.push_buffer(buffer).is_err() {
                    return;
                }
            }
            Ok(None) => {
                // Where the pipeline is over already, it needs no end.
                let _ = source.end_of_stream();
                return;
            }
            Err(reason) => return gst::element_error!(source, gst::ResourceError::Read, ("{reason}")),
        }
    }
}

/// What goes to the pipeline next, which may be nothing of what came; `None` at the end.
async fn next(stream: &mut Stream, parts: Option<&mut Multipart>) -> Result<Option<gst::Buffer>, String> {
    if parts.as_ref().is_some_and(|parts| parts.is_over()) {
        return Ok(None);
    }
    let Some(bytes) = stream.next().await.map_err(|err| err.to_string())? else { return Ok(None) };
    Ok(Some(match parts {
        Some(parts) => gst::Buffer::from_slice(parts.pass(&bytes).map_err(|failure| failure.reason)?),
        None => gst::Buffer::from_slice(bytes),
    }))
}

/// Whether the pipeline takes the stream for pictures in parts: any other, as of FLV, is passed on as it comes.
fn is_taken_apart(source: &AppSrc) -> bool {
    let pipeline = successors(source.parent(), |inner| inner.parent()).last();
    let takes_apart =
        |element: gst::Element| element.factory().is_some_and(|it| it.name() == "multipartdemux");
    let elements = pipeline.and_downcast::<gst::Bin>().map(|pipeline| pipeline.iterate_recurse());
    elements.is_some_and(|elements| elements.into_iter().flatten().any(takes_apart))
}

/// Whether nothing that is pushed would be taken any more.
fn is_over(source: &AppSrc) -> bool {
    source.static_pad("src").is_none_or(|pad| pad.pad_flags().contains(gst::PadFlags::FLUSHING))
}

async fn open(settings: ClientSettings, target: &str) -> Result<Stream, Failure> {
    let location = settings.location.clone();
    let opened = async { HttpClient::in_place_of(settings.into())?.open(target, LONGEST_START).await };
    opened.await.map_err(|err| {
        let failure = Failure::from(err);
        Failure { reason: format!("{location}: {}", failure.reason), ..failure }
    })
}
