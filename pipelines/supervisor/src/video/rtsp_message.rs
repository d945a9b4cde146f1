// SPDX-License-Identifier: MPL-2.0

//! What passes over an RTSP connection (RFC 2326): requests, responses, and between them packets of the streams.

use std::io::{self, ErrorKind};

use tokio::io::{AsyncBufRead, AsyncBufReadExt, AsyncReadExt};

/// Longer heads are none.
const MAX_HEAD_BYTES: usize = 64 * 1024;
/// Descriptions of streams have a few kilobytes.
const MAX_BODY_BYTES: usize = 64 * 1024;

/// One thing on the wire.
#[derive(Debug)]
pub enum Item {
    /// A packet of a stream, with its four bytes of head (section 10.12).
    Packet(Vec<u8>),
    /// A request or a response.
    Message(Message),
}

/// A request or a response. Whoever reads it next finds the same in it: what others might read in another way is refused.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Message {
    /// The first line, its words with one space between them.
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
            if line.contains(|c: char| c.is_control() && c != '\t') {
                return Err(no_rtsp("a head that is no text"));
            }
            match line.split_once(':') {
                _ if start.is_empty() => {
                    start = first_line(line).ok_or_else(|| no_rtsp("neither a request nor a response"))?;
                }
                _ if line.is_empty() => break,
                // To some it goes on with the header before.
                _ if line.starts_with([' ', '\t']) => {}
                Some((name, value)) if is_token(name.trim_end()) => {
                    headers.push((name.trim_end().to_owned(), value.trim().to_owned()))
                }
                Some(_) => {}
                None => return Err(no_rtsp("a header without a name")),
            }
        }
        let mut message = Self { start, headers, body: Vec::new() };
        let length = {
            let mut lengths = message.headers_of("content-length");
            let first = lengths.next();
            let length = first.map_or(Ok(0), str::parse).ok();
            // Others may go by the second.
            length.filter(|length| *length <= MAX_BODY_BYTES && lengths.all(|other| Some(other) == first))
        };
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

/// The first line of a message: `None` where it is neither a request's nor a response's (RFC 2326, sections 6.1 and 7.1).
fn first_line(line: &str) -> Option<String> {
    let words: Vec<_> = line.split_whitespace().collect();
    let is_version = |word: &str| {
        let version = word.strip_prefix("RTSP/").and_then(|version| version.split_once('.'));
        version.is_some_and(|(major, minor)| is_number(major) && is_number(minor))
    };
    let is_right = match words[..] {
        [version, status, ..] if is_version(version) => status.len() == 3 && is_number(status),
        // What begins like a version is a response to others.
        [method, _, version] => {
            is_version(version)
                && method.bytes().all(|byte| byte.is_ascii_uppercase() || byte == b'_')
                && !method.starts_with("RTSP")
                && !method.starts_with("HTTP")
        }
        _ => false,
    };
    is_right.then(|| words.join(" "))
}

fn is_number(word: &str) -> bool {
    !word.is_empty() && word.bytes().all(|byte| byte.is_ascii_digit())
}

/// Whether it can be the name of a header.
fn is_token(name: &str) -> bool {
    !name.is_empty() && name.bytes().all(|byte| byte.is_ascii_alphanumeric() || b"-_.".contains(&byte))
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

    /// `rtspsrc` takes any space between words, and would follow a redirection that is none here.
    #[tokio::test]
    async fn a_status_is_a_status_however_it_is_spaced() {
        for wire in
            ["RTSP/1.0  302 Found\r\n\r\n", "RTSP/1.0\t302\tFound\r\n\r\n", " RTSP/1.0 302 Found\r\n\r\n"]
        {
            let items = all(wire.as_bytes()).await.unwrap();
            let [Item::Message(response)] = &items[..] else { panic!("{items:?}") };
            assert_eq!(response.status(), Some(302), "{wire:?}");
            assert_eq!(response.to_bytes(), b"RTSP/1.0 302 Found\r\n\r\n");
        }
    }

    #[tokio::test]
    async fn what_has_no_name_of_a_header_is_left_out() {
        let items = all(b"RTSP/1.0 200 OK\r\n Content-Length: 5\r\n\tmore\r\nA b: 1\r\nCSeq : 2\r\n\r\n")
            .await
            .unwrap();
        assert_eq!(items[0].to_bytes(), b"RTSP/1.0 200 OK\r\nCSeq: 2\r\n\r\n");
    }

    #[tokio::test]
    async fn what_others_might_read_in_another_way_is_an_error() {
        for wire in [
            "rtsp/1.0 302 Found\r\n\r\n",
            "RTSP/1.0 +302 Found\r\n\r\n",
            "RTSP/1.0 0302 Found\r\n\r\n",
            "RTSP/1 302 Found\r\n\r\n",
            "HTTP/1.0 302 RTSP/1.0\r\n\r\n",
            "HTTP 302 RTSP/1.0\r\n\r\n",
            "RTSP/1.0 200 OK\r\nX: a\rContent-Length: 5\r\n\r\n",
            "RTSP/1.0 200 OK\r\nX: \0\r\n\r\n",
            "RTSP/1.0 200 OK\r\nContent-Length: 1\r\nContent-Length: 0\r\n\r\na",
        ] {
            assert!(all(wire.as_bytes()).await.is_err(), "{wire:?}");
        }
    }

    #[tokio::test]
    async fn what_is_no_rtsp_is_an_error() {
        let length = format!("RTSP/1.0 200 OK\r\nContent-Length: {}\r\n\r\n", MAX_BODY_BYTES + 1);
        let too_long = [length.as_bytes(), &vec![0; MAX_BODY_BYTES + 1]].concat();
        let endless = [b"RTSP/1.0 200 OK\r\nX: ".as_slice(), &vec![b'x'; MAX_HEAD_BYTES]].concat();
        for wire in [
            &b"HTTP"[..],
            b"a\r\nb\r\n\r\n",
            b"a b c\r\nContent-Length: -1\r\n\r\n",
            b"RTSP/1.0 200 OK\r\nb\r\n\r\n",
            b"RTSP/1.0 200 OK\r\nContent-Length: -1\r\n\r\n",
            b"RTSP/1.0 200 OK\r\nContent-Length: 5\r\n\r\nfour",
            &too_long,
            b"$\0\0\x09abc",
            &endless,
        ] {
            assert!(all(wire).await.is_err(), "{wire:?}");
        }
    }
}
