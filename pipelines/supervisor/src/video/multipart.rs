// SPDX-License-Identifier: MPL-2.0

//! A camera's pictures by HTTP, as parts of an answer that does not end (RFC 2046, section 5.1). `multipartdemux` makes an output for
//! every media type that a part names, and keeps it until the pipeline ends, and its name for ever. So it is given pictures only.

use std::mem;

use session::http::excerpt;

use super::Failure;

/// Of the line that begins every part, bytes.
const LONGEST_BOUNDARY: usize = 256;
/// From one body to the next, bytes.
const LONGEST_HEAD: usize = 4 * 1024;
/// Bytes of a picture; a stream that takes more without one is ended behind this, too.
const LONGEST_PICTURE: usize = 64 * 1024 * 1024;

/// Reads parts as they come, and writes those that are pictures.
#[derive(Debug, Default)]
pub struct Multipart {
    state: State,
    /// The line that begins every part, once there was one.
    boundary: Vec<u8>,
    /// The beginning of a line whose end has not come yet.
    line: Vec<u8>,
    /// Bytes since the last body.
    between: usize,
    /// What the head says of the body.
    part: Part,
    /// Of a picture that does not say how long it is.
    kept: Vec<u8>,
}

/// What comes next.
#[derive(Debug, Clone, Copy, Default)]
enum State {
    /// Lines before a part.
    #[default]
    Between,
    /// Lines of its head.
    Head,
    /// So many bytes of a body.
    Sized(usize),
    /// A body that ends where another part begins, which it does not do before so many bytes of what is kept.
    Unsized(usize),
    /// Nothing.
    Over,
}

/// As its head says.
#[derive(Debug)]
struct Part {
    is_picture: bool,
    length: Option<usize>,
}

impl Default for Part {
    /// Some cameras say nothing of their pictures.
    fn default() -> Self {
        Self { is_picture: true, length: None }
    }
}

impl Part {
    /// Takes a line of the head.
    fn read(&mut self, line: &[u8]) -> Result<(), Failure> {
        let line = String::from_utf8_lossy(line);
        let Some((name, value)) = line.split_once(':') else { return Ok(()) };
        let (name, value) = (name.trim_end(), value.trim());
        if name.eq_ignore_ascii_case("content-type") {
            self.is_picture = is_jpeg(value);
        } else if name.eq_ignore_ascii_case("content-length") {
            let end = value.find(|c: char| !c.is_ascii_digit()).unwrap_or(value.len());
            let length = value[..end].parse::<usize>().ok().filter(|length| *length <= LONGEST_PICTURE);
            let wrong = || format!("a picture of `{}` bytes is announced, against 64 MiB", excerpt(value));
            self.length = Some(length.ok_or_else(|| Failure::new(wrong()))?);
        }
        Ok(())
    }
}

impl Multipart {
    /// What is passed on of the next bytes, however they are cut. A picture that says how long it is passes as it comes, so that it
    /// keeps the time at which it began; any other once it is whole.
    ///
    /// # Errors
    /// What comes is no stream of pictures, or one of them is too large.
    pub fn pass(&mut self, bytes: &[u8]) -> Result<Vec<u8>, Failure> {
        let (mut left, mut passed) = (bytes, Vec::new());
        while !left.is_empty() {
            let used = match self.state {
                State::Between | State::Head => self.read_line(left, &mut passed)?,
                State::Sized(length) => self.read_sized(left, length, &mut passed),
                State::Unsized(matched) => self.read_unsized(left, matched, &mut passed)?,
                State::Over => left.len(),
            };
            left = left.get(used..).unwrap_or_default();
        }
        Ok(passed)
    }

    /// Whether the camera has ended the stream.
    pub fn is_over(&self) -> bool {
        matches!(self.state, State::Over)
    }

    fn read_line(&mut self, bytes: &[u8], passed: &mut Vec<u8>) -> Result<usize, Failure> {
        let end = bytes.iter().position(|byte| *byte == b'\n');
        let used = end.map_or(bytes.len(), |end| end + 1);
        self.between += used;
        if self.between > LONGEST_HEAD {
            return Err(Failure::new("what comes is no stream of pictures: 4 KiB came without one"));
        }
        self.line.extend_from_slice(&bytes[..used]);
        if end.is_some() {
            let line = mem::take(&mut self.line);
            self.take_line(line.trim_ascii_end(), passed)?;
        }
        Ok(used)
    }

    fn take_line(&mut self, line: &[u8], passed: &mut Vec<u8>) -> Result<(), Failure> {
        match self.state {
            State::Head if line.is_empty() => self.begin_body(passed),
            State::Head => self.part.read(line)?,
            _ => self.seek_part(line)?,
        }
        Ok(())
    }

    /// Looks whether a line begins a part, or ends the stream. The first that can begin one says how all others do.
    fn seek_part(&mut self, line: &[u8]) -> Result<(), Failure> {
        if self.boundary.is_empty() {
            if line.len() <= 2 || !line.starts_with(b"--") {
                return Ok(());
            }
            if line.len() > LONGEST_BOUNDARY {
                return Err(Failure::new("what comes is no stream of pictures: its boundary is too long"));
            }
            self.boundary = line.to_vec();
        }
        let Some(rest) = line.strip_prefix(self.boundary.as_slice()) else { return Ok(()) };
        self.state = if rest.starts_with(b"--") { State::Over } else { State::Head };
        self.part = Part::default();
        Ok(())
    }

    fn begin_body(&mut self, passed: &mut Vec<u8>) {
        self.between = 0;
        self.state = match self.part.length {
            // No picture.
            Some(0) => State::Between,
            Some(length) => {
                if self.part.is_picture {
                    self.write_head(length, passed);
                }
                State::Sized(length)
            }
            None => State::Unsized(0),
        };
    }

    fn read_sized(&mut self, bytes: &[u8], length: usize, passed: &mut Vec<u8>) -> usize {
        let used = length.min(bytes.len());
        let is_end = used == length;
        if self.part.is_picture {
            passed.extend_from_slice(&bytes[..used]);
            if is_end {
                passed.extend_from_slice(b"\r\n");
            }
        }
        self.state = if is_end { State::Between } else { State::Sized(length - used) };
        used
    }

    /// Looks for the boundary, from where it may begin in what was kept. Of what is no picture no more is kept than that takes.
    fn read_unsized(
        &mut self,
        bytes: &[u8],
        searched: usize,
        passed: &mut Vec<u8>,
    ) -> Result<usize, Failure> {
        let before = self.kept.len();
        self.kept.extend_from_slice(bytes);
        let length = self.boundary.len();
        let begin = self.kept[searched..].windows(length).position(|window| window == self.boundary);
        if let Some(begin) = begin.map(|begin| searched + begin) {
            self.end_unsized(begin, passed);
            return Ok(begin + length - before);
        }
        if !self.part.is_picture {
            self.kept.drain(..self.kept.len().saturating_sub(length - 1));
        }
        if self.kept.len() > LONGEST_PICTURE {
            return Err(Failure::new("a picture of more than 64 MiB comes"));
        }
        self.state = State::Unsized(self.kept.len().saturating_sub(length - 1));
        Ok(bytes.len())
    }

    /// Passes a picture on that ends where the next part begins, and goes on with the line that begins that.
    fn end_unsized(&mut self, end: usize, passed: &mut Vec<u8>) {
        let kept = mem::take(&mut self.kept);
        let picture = kept[..end].strip_suffix(b"\n").unwrap_or(&kept[..end]);
        let picture = picture.strip_suffix(b"\r").unwrap_or(picture);
        if self.part.is_picture && !picture.is_empty() {
            self.write_head(picture.len(), passed);
            passed.extend_from_slice(picture);
            passed.extend_from_slice(b"\r\n");
        }
        self.line = self.boundary.clone();
        self.between = self.line.len();
        self.state = State::Between;
    }

    fn write_head(&self, length: usize, passed: &mut Vec<u8>) {
        passed.extend_from_slice(&self.boundary);
        let rest = format!("\r\nContent-Type: image/jpeg\r\nContent-Length: {length}\r\n\r\n");
        passed.extend_from_slice(rest.as_bytes());
    }
}

/// Whether a media type is JPEG's, or what some cameras take for that.
fn is_jpeg(value: &str) -> bool {
    let kind = value.split(';').next().unwrap_or_default().trim_end();
    ["image/jpeg", "image/jpg"].iter().any(|jpeg| kind.eq_ignore_ascii_case(jpeg))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// As an Axis camera sends it.
    const AXIS: &[u8] = b"--myboundary\r\nContent-Type: image/jpeg\r\nContent-Length: 5\r\n\r\nfirst\r\n\
        --myboundary\r\nContent-Type: image/jpeg\r\nContent-Length: 6\r\n\r\nsecond\r\n--myboundary\r\n";

    /// What is passed on of bytes that come in pieces of this size; nothing where they are refused.
    fn in_pieces(bytes: &[u8], size: usize) -> Option<Vec<u8>> {
        let mut parts = Multipart::default();
        let passed: Result<Vec<_>, _> = bytes.chunks(size.max(1)).map(|piece| parts.pass(piece)).collect();
        Some(passed.ok()?.concat())
    }

    /// The same in pieces of any size.
    #[track_caller]
    fn passed(bytes: &[u8]) -> Option<Vec<u8>> {
        let whole = in_pieces(bytes, bytes.len());
        for size in [1, 2, 3, 7] {
            assert_eq!(in_pieces(bytes, size), whole, "in pieces of {size}");
        }
        if let Some(whole) = &whole {
            assert_eq!(in_pieces(whole, whole.len()).as_ref(), Some(whole), "passed on once more");
        }
        whole
    }

    #[track_caller]
    fn text(bytes: &[u8]) -> String {
        String::from_utf8(passed(bytes).unwrap()).unwrap()
    }

    fn picture(boundary: &str, body: &str) -> String {
        let length = body.len();
        format!("{boundary}\r\nContent-Type: image/jpeg\r\nContent-Length: {length}\r\n\r\n{body}\r\n")
    }

    #[test]
    fn pictures_of_an_axis_camera_pass_as_they_are() {
        assert_eq!(text(AXIS).as_bytes(), AXIS.strip_suffix(b"--myboundary\r\n").unwrap());
    }

    /// Later, their times would be those of their ends.
    #[test]
    fn a_picture_of_a_known_length_passes_as_it_comes() {
        let mut parts = Multipart::default();
        let head = parts.pass(b"--b\nContent-Length: 5\n\nfi").unwrap();
        assert_eq!(head, b"--b\r\nContent-Type: image/jpeg\r\nContent-Length: 5\r\n\r\nfi");
        assert_eq!(parts.pass(b"rs").unwrap(), b"rs");
        assert_eq!(parts.pass(b"t").unwrap(), b"t\r\n");
    }

    #[test]
    fn pictures_of_no_known_length_end_with_the_next_part() {
        let said = b"\r\n--b\r\nContent-type:IMAGE/JPEG\r\n\r\n1\n--a\r\n--\r\n--b\r\n\r\n\n\r\n--b\n\n3\n--b\n\n--b\n\n4";
        let [one, two, three] = ["1\n--a\r\n--", "\n", "3"].map(|body| picture("--b", body));
        assert_eq!(text(said), format!("{one}{two}{three}"));
    }

    /// Each other kind would be an output that stays.
    #[test]
    fn parts_that_are_no_pictures_are_left_out() {
        let audio = "--b\r\nContent-Type: audio/basic\r\nContent-Length: 9\r\n\r\n\r\n--b\r\n\r\n\r\n";
        let xml = "--b\r\nContent-Type: application/xml\r\n\r\n<a>\r\n</a>\r\n";
        let none = "--b\r\nContent-Type: image/jpeg\r\nContent-Length: 0\r\n\r\n\r\n";
        let other = "--b\r\ncontent-type : image/JPG; q=1\r\ncontent-length : 3\r\n\r\ntwo\r\n";
        let (one, two) = (picture("--b", "one"), picture("--b", "two"));
        let said = format!("{audio}{one}{xml}{none}{xml}{other}{audio}");
        assert_eq!(text(said.as_bytes()), format!("{one}{two}"));
    }

    #[test]
    fn a_boundary_in_a_picture_of_a_known_length_is_part_of_it() {
        let said = picture("--b", "a\r\n--b--\r\n\r\nz");
        assert_eq!(text(said.as_bytes()), said);
    }

    #[test]
    fn what_comes_after_the_end_is_nothing() {
        let said = picture("--b", "one");
        let more = format!("preamble\n--\n{said}--b--\r\n{said}");
        assert_eq!(text(more.as_bytes()), said);
        let mut parts = Multipart::default();
        parts.pass(said.as_bytes()).unwrap();
        assert!(!parts.is_over());
        parts.pass(b"--b--\n").unwrap();
        assert!(parts.is_over());
    }

    #[test]
    fn what_is_no_stream_of_pictures_is_refused() {
        let jpeg = [&b"\xff\xd8\xff\xe0"[..], &[0; LONGEST_HEAD]].concat();
        let endless = format!("--b\r\nX: {}", "a".repeat(LONGEST_HEAD));
        let long = format!("--{}\r\n", "b".repeat(LONGEST_BOUNDARY));
        let lengths = ["-1", "67108865", "99999999999999999999", "many", ""];
        let lengths = lengths.map(|length| format!("--b\r\nContent-Length: {length}\r\n\r\n"));
        let texts = [endless, long].into_iter().chain(lengths).map(String::into_bytes);
        for said in texts.chain([jpeg]) {
            let begin = String::from_utf8_lossy(&said[..said.len().min(64)]).into_owned();
            assert_eq!(passed(&said), None, "{begin}");
        }
        let longest = format!("--b\r\nContent-Length: {LONGEST_PICTURE}\r\n\r\n");
        assert!(text(longest.as_bytes()).ends_with("Content-Length: 67108864\r\n\r\n"));
    }

    #[test]
    fn a_picture_that_does_not_end_is_refused() {
        let mut parts = Multipart::default();
        parts.pass(b"--b\n\n").unwrap();
        parts.kept = vec![0; LONGEST_PICTURE - 1];
        parts.pass(b"a").unwrap();
        assert!(parts.pass(b"a").is_err());
    }

    #[test]
    fn nothing_that_comes_breaks_it() {
        let words: [&[u8]; 8] =
            [b"--b", b"--", b"\r", b"\n", b"\r\n\r\n", b"Content-Length: 3", b"Content-Type: a", b"\xff"];
        let mut state = 1u64;
        let mut draw = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            usize::from(state.to_be_bytes()[0])
        };
        for _ in 0..10_000 {
            let said: Vec<u8> = (0..draw() % 32).flat_map(|_| words[draw() % words.len()].to_vec()).collect();
            passed(&said);
        }
    }
}
