// SPDX-License-Identifier: MPL-2.0

//! What others say to the program, for who tries it with anything at all: whether it was understood. Nothing panics.

use bytes::BytesMut;
use rumqttc::{MqttState, Packet};

use crate::camera::{picture_size, process};
use crate::config::Config;
use crate::handover::Exchange;
use crate::http;

/// More than a broker may say at once by default.
const LONGEST_PACKET: usize = 10 * 1024;
/// As many messages as may wait for a broker's word by default.
const UNCONFIRMED: u16 = 100;

/// The text of a file of cameras. GStreamer has to be initialised.
pub fn configuration(text: &str) -> bool {
    Config::parse(text).is_ok()
}

/// What somebody says who is connected to the page.
pub fn page(said: &[u8]) -> bool {
    http::answer_to(said).starts_with(b"HTTP/1.1 2")
}

/// How somebody says who they are, to whom that is asked.
pub fn log_in(authorization: &[u8]) -> bool {
    http::lets_in(authorization)
}

/// What a broker says.
pub fn broker(said: &[u8]) -> bool {
    let mut stream = BytesMut::from(said);
    let mut state = MqttState::new(UNCONFIRMED, false);
    let mut understood = false;
    while let Ok(packet) = Packet::read(&mut stream, LONGEST_PACKET) {
        understood = true;
        if state.handle_incoming_packet(packet).is_err() {
            break;
        }
    }
    understood
}

/// A line of a camera's own process. GStreamer has to be initialised.
pub fn word(line: &[u8]) -> bool {
    process::hear(line)
}

/// What another process says of who its cameras see.
pub fn tracks(said: &[u8]) -> bool {
    let (exchange, _) = Exchange::new();
    exchange.listen_for(["door".to_owned()].into());
    exchange.hear("door", said).is_ok()
}

/// A stream of pictures, of which the first byte chooses the codec; whether it announces a size.
pub fn picture(stream: &[u8]) -> bool {
    stream.split_first().is_some_and(|(codec, stream)| picture_size(*codec, stream).is_some())
}
