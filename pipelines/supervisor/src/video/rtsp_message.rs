// SPDX-License-Identifier: MPL-2.0

//! What passes over an RTSP connection (RFC 2326): requests, responses, and between them packets of the streams.

use std::io::{self, ErrorKind};

use tokio::io::{AsyncBufRead, AsyncBufReadExt, AsyncReadExt};

/// Longer heads are none.
const MAX_HEAD_BYTES: usize = 64 * 1024;
/// Descriptions of streams have a few kilobytes.
const MAX_BODY_BYTES: usize = 1024 * 1024;

/// One thing on the wire.
#[derive(Debug)]
pub enum Item {
    /// A packet of a stream, with its four bytes of head (section 10.12).
    Packet(Vec<u8>),
    /// A request or a response.
    Message(Message),
}

/// A request or a response.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Message {
    /// The first line.
    pub start: String,
    /// In their order, names as they came.
    pub headers: Vec<(String, String)>,
    /// What follows the headers.
    pub body: Vec<u8>,
}

impl Item {
    /// The next; `None` at the end.
    ///
    /// # Errors
    /// Those of the connection, and what is no RTSP.
    pub async fn read(wire: &mut (impl AsyncBufRead + Unpin)) -> io::Result<Option<Self>> {
        // Empty lines before anything are nothing (RFC 2326, section 4.1).
        while let Some(b'\r' | b'\n') = wire.fill_buf().await?.first() {
            wire.consume(1);
        }
        match wire.fill_buf().await?.first() {
            None => Ok(None),
            Some(b'$') => {
                let mut packet = vec![0; 4];
                wire.read_exact(&mut packet).await?;
                let length = usize::from(u16::from_be_bytes([packet[2], packet[3]]));
                packet.resize(4 + length, 0);
                wire.read_exact(&mut packet[4..]).await?;
                Ok(Some(Self::Packet(packet)))
            }
            Some(_) => Ok(Some(Self::Message(Message::read(wire).await?))),
        }
    }

    /// As it goes on the wire.
    pub fn to_bytes(&self) -> Vec<u8> {
        match self {
            Self::Packet(packet) => packet.clone(),
            Self::Message(message) => message.to_bytes(),
        }
    }
}

impl Message {
    /// Where something is that is neither an end nor an empty line.
    async fn read(wire: &mut (impl AsyncBufRead + Unpin)) -> io::Result<Self> {
        let (mut start, mut headers, mut read) = (String::new(), Vec::new(), 0);
        loop {
            let mut line = Vec::new();
            let left = u64::try_from(MAX_HEAD_BYTES - read).unwrap_or(0);
            let bytes = (&mut *wire).take(left).read_until(b'\n', &mut line).await?;
            read += bytes;
            if bytes == 0 || !line.ends_with(b"\n") {
                return Err(no_rtsp("a head without an end"));
            }
            let line = String::from_utf8(line).map_err(|_| no_rtsp("a head that is no text"))?;
            let line = line.trim_end_matches(['\r', '\n']);
            match (start.is_empty(), line.split_once(':')) {
                (true, _) => line.clone_into(&mut start),
                (false, _) if line.is_empty() => break,
                (false, Some((name, value))) => {
                    headers.push((name.trim().to_owned(), value.trim().to_owned()))
                }
                (false, None) => return Err(no_rtsp("a header without a name")),
            }
        }
        let mut message = Self { start, headers, body: Vec::new() };
        let length = message.header("content-length").map_or(Ok(0), str::parse);
        let length = length.ok().filter(|length| *length <= MAX_BODY_BYTES);
        message.body.resize(length.ok_or_else(|| no_rtsp("a body of no length"))?, 0);
        wire.read_exact(&mut message.body).await?;
        Ok(message)
    }

    /// The first header of that name.
    pub fn header(&self, name: &str) -> Option<&str> {
        self.headers
            .iter()
            .find(|(other, _)| other.eq_ignore_ascii_case(name))
            .map(|(_, value)| value.as_str())
    }

    /// All headers of that name.
    pub fn headers_of<'a>(&'a self, name: &'a str) -> impl Iterator<Item = &'a str> {
        let of_name = move |(other, _): &&(String, String)| other.eq_ignore_ascii_case(name);
        self.headers.iter().filter(of_name).map(|(_, value)| value.as_str())
    }

    /// Method and address, where it is a request.
    pub fn request(&self) -> Option<(&str, &str)> {
        let mut words = self.start.split(' ');
        let request = (words.next()?, words.next()?);
        words.next().filter(|version| version.starts_with("RTSP/")).map(|_| request)
    }

    /// The status, where it is a response.
    pub fn status(&self) -> Option<u16> {
        self.start.strip_prefix("RTSP/")?.split(' ').nth(1)?.parse().ok()
    }

    /// As it goes on the wire.
    pub fn to_bytes(&self) -> Vec<u8> {
        let mut text = format!("{}\r\n", self.start);
        for (name, value) in &self.headers {
            text += &format!("{name}: {value}\r\n");
        }
        text += "\r\n";
        [text.as_bytes(), &self.body].concat()
    }
}

fn no_rtsp(what: &str) -> io::Error {
    io::Error::new(ErrorKind::InvalidData, format!("{what} came instead of RTSP"))
}

#[cfg(test)]
mod tests {
    use super::*;

    async fn all(mut wire: &[u8]) -> io::Result<Vec<Item>> {
        let mut items = Vec::new();
        while let Some(item) = Item::read(&mut wire).await? {
            items.push(item);
        }
        Ok(items)
    }

    #[tokio::test]
    async fn requests_responses_and_packets_pass_as_they_are() {
        let wire = b"DESCRIBE rtsp://a/b?c=d RTSP/1.0\r\nCSeq: 2\r\n\r\n$\0\0\x02\r\nRTSP/1.0 200 OK\r\nContent-Length: 3\r\n\r\nv=0$\x01\0\0";
        let items = all(wire).await.unwrap();
        assert_eq!(items.iter().flat_map(Item::to_bytes).collect::<Vec<_>>(), wire);
        let [Item::Message(request), Item::Packet(_), Item::Message(response), Item::Packet(_)] = &items[..]
        else {
            panic!("{items:?}")
        };
        assert_eq!(request.request(), Some(("DESCRIBE", "rtsp://a/b?c=d")));
        assert_eq!((request.status(), response.status(), response.request()), (None, Some(200), None));
        assert_eq!(request.header("cseq"), Some("2"));
    }

    /// Passed on as the first line of a message, it would be a packet to who reads it next.
    #[tokio::test]
    async fn empty_lines_before_something_are_nothing() {
        let items = all(b"\r\n\n$\0\0\x01x\r\n\r\nRTSP/1.0 200 OK\r\n\r\n\r\n").await.unwrap();
        assert!(matches!(&items[..], [Item::Packet(_), Item::Message(_)]), "{items:?}");
    }

    #[tokio::test]
    async fn what_is_no_rtsp_is_an_error() {
        let endless = [b"RTSP/1.0 200 OK\r\nX: ".as_slice(), &vec![b'x'; MAX_HEAD_BYTES]].concat();
        for wire in [
            &b"HTTP"[..],
            b"a\r\nb\r\n\r\n",
            b"a b c\r\nContent-Length: -1\r\n\r\n",
            b"$\0\0\x09abc",
            &endless,
        ] {
            assert!(all(wire).await.is_err(), "{wire:?}");
        }
    }
}
