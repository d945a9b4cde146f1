// SPDX-License-Identifier: MPL-2.0

//! Which video streams a camera has, and where they are.

use std::fmt;

use crate::soap::{Element, number};

/// More profiles than a camera has.
const MOST: usize = 1024;

/// Where RTSP is served where an address does not say (RFC 7826, section 4.2).
const RTSP_PORT: u16 = 554;

/// Sizes that following needs no more than, and no less.
const ENOUGH: ((u32, u32), (u32, u32)) = ((640, 480), (1280, 720));

/// How a stream is encoded; those that are best to decode first.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Encoding {
    /// H.264.
    H264,
    /// H.265.
    H265,
    /// MPEG-4, part 2.
    Mpeg4,
    /// JPEG.
    Jpeg,
}

/// The video stream of a media profile.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct VideoStream {
    /// Token of its profile.
    pub profile: String,
    /// How it is encoded.
    pub encoding: Encoding,
    /// Width and height in pixels.
    pub size: (u32, u32),
}

/// Where a stream is. The host is left aside: a camera is often not reached by the one that it tells.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct StreamAddress {
    /// Port of its RTSP server.
    pub port: u16,
    /// Path and query.
    pub target: String,
}

impl Encoding {
    /// By the names of Media 1 and of Media 2, which are IANA's.
    fn parse(name: &str) -> Option<Self> {
        match name.to_ascii_uppercase().as_str() {
            "H264" => Some(Self::H264),
            "H265" | "HEVC" => Some(Self::H265),
            "MPEG4" | "MPV4-ES" => Some(Self::Mpeg4),
            "JPEG" => Some(Self::Jpeg),
            _ => None,
        }
    }
}

impl fmt::Display for Encoding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::H264 => "H.264",
            Self::H265 => "H.265",
            Self::Mpeg4 => "MPEG-4",
            Self::Jpeg => "JPEG",
        })
    }
}

impl fmt::Display for VideoStream {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} {}x{}", self.encoding, self.size.0, self.size.1)
    }
}

impl VideoStream {
    /// By how many doublings its pixels are too few or too many.
    fn distance(&self, size: Option<(u32, u32)>) -> f64 {
        let pixels = |(width, height): (u32, u32)| f64::from(width) * f64::from(height);
        let (fewest, most) = size.map_or(ENOUGH, |size| (size, size));
        let own = pixels(self.size).max(1.0);
        (pixels(fewest) / own).log2().max((own / pixels(most)).log2()).max(0.0)
    }

    /// The stream to follow by: of this encoding, or of any but JPEG; nearest to this size, or to 640x480 to 1280x720; of
    /// those the one that is easiest to decode, and shows most.
    pub fn best(streams: &[Self], encoding: Option<Encoding>, size: Option<(u32, u32)>) -> Option<&Self> {
        let is_wanted = |stream: &&Self| match encoding {
            Some(encoding) => stream.encoding == encoding,
            None => stream.encoding != Encoding::Jpeg,
        };
        streams.iter().filter(is_wanted).min_by(|a, b| {
            let by_distance = a.distance(size).total_cmp(&b.distance(size));
            by_distance.then(a.encoding.cmp(&b.encoding)).then(b.size.cmp(&a.size))
        })
    }
}

/// Reads `GetProfilesResponse` of Media 1 or Media 2.
pub fn parse_streams(body: &Element) -> Vec<VideoStream> {
    let Some(response) = body.child("GetProfilesResponse") else { return Vec::new() };
    let streams = response.children("Profiles").take(MOST).filter_map(|profile| {
        let encoder = profile
            .child("VideoEncoderConfiguration")
            .or_else(|| profile.find(&["Configurations", "VideoEncoder"]))?;
        let side = |name| {
            number(encoder.find(&["Resolution", name])?.text())
                .filter(|side| (1.0..=65_535.0).contains(side))
                .map(|side| side as u32)
        };
        Some(VideoStream {
            profile: profile.attribute("token")?.to_owned(),
            encoding: Encoding::parse(encoder.child("Encoding")?.text())?,
            size: (side("Width")?, side("Height")?),
        })
    });
    streams.collect()
}

/// Reads `GetStreamUriResponse` of Media 1 or Media 2.
pub fn parse_stream_address(body: &Element) -> Option<StreamAddress> {
    let response = body.child("GetStreamUriResponse")?;
    let told = response.find(&["MediaUri", "Uri"]).or_else(|| response.child("Uri"))?.text();
    let rest = told.strip_prefix("rtsp://").or_else(|| told.strip_prefix("rtsps://"))?;
    let path = rest.find('/').unwrap_or(rest.len());
    let (authority, target) = rest.split_at(path);
    let host = authority.rsplit('@').next()?;
    let port = host.rsplit_once(':').filter(|(_, port)| !port.contains(']'));
    let port = port.map_or(Some(RTSP_PORT), |(_, port)| port.parse().ok())?;
    let fits = target.len() <= 2048 && target.chars().all(|c| c.is_ascii_graphic());
    fits.then(|| StreamAddress { port, target: target.to_owned() })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn body(xml: &str) -> Element {
        Element::parse(&format!("<Body>{xml}</Body>")).unwrap()
    }

    fn stream(encoding: Encoding, size: (u32, u32)) -> VideoStream {
        VideoStream { profile: format!("{encoding} {}", size.0), encoding, size }
    }

    #[test]
    fn streams_of_both_media_services_are_read() {
        let one = "<GetProfilesResponse><Profiles token='a'><VideoEncoderConfiguration><Encoding>H264</Encoding><Resolution><Width>1920</Width><Height>1080</Height></Resolution></VideoEncoderConfiguration></Profiles><Profiles token='b'/></GetProfilesResponse>";
        let two = "<GetProfilesResponse><Profiles token='a'><Configurations><VideoEncoder><Encoding>H265</Encoding><Resolution><Width>640</Width><Height>480</Height></Resolution></VideoEncoder></Configurations></Profiles></GetProfilesResponse>";
        let read = |xml| parse_streams(&body(xml));
        let expected = |encoding, size| VideoStream { profile: "a".to_owned(), encoding, size };
        assert_eq!(read(one), [expected(Encoding::H264, (1920, 1080))]);
        assert_eq!(read(two), [expected(Encoding::H265, (640, 480))]);
    }

    #[test]
    fn the_best_stream_is_neither_large_nor_small() {
        use Encoding::{H264, H265, Jpeg};
        let all = [
            stream(H265, (3840, 2160)),
            stream(H264, (1920, 1080)),
            stream(Jpeg, (1280, 720)),
            stream(H265, (1280, 720)),
            stream(H264, (704, 576)),
            stream(H264, (640, 480)),
            stream(H264, (320, 240)),
        ];
        let best = |encoding, size| VideoStream::best(&all, encoding, size).unwrap().to_string();
        assert_eq!(best(None, None), "H.264 704x576");
        assert_eq!(best(Some(H265), None), "H.265 1280x720");
        assert_eq!(best(None, Some((1920, 1080))), "H.264 1920x1080");
        assert_eq!(best(Some(H264), Some((320, 240))), "H.264 320x240");
        assert_eq!(VideoStream::best(&all[..1], None, None).unwrap().to_string(), "H.265 3840x2160");
        assert_eq!(VideoStream::best(&all, Some(Encoding::Mpeg4), None), None);
    }

    #[test]
    fn addresses_are_read_without_their_host() {
        let address = |uri: &str| {
            let xml =
                format!("<GetStreamUriResponse><MediaUri><Uri>{uri}</Uri></MediaUri></GetStreamUriResponse>");
            parse_stream_address(&body(&xml))
        };
        let is = |port, target: &str| Some(StreamAddress { port, target: target.to_owned() });
        assert_eq!(address("rtsp://10.0.0.1/s?a=1&amp;b=2"), is(554, "/s?a=1&b=2"));
        assert_eq!(address("rtsp://u:p@10.0.0.1:8554/s"), is(8554, "/s"));
        assert_eq!(address("rtsp://[fe80::1]:8554/s"), is(8554, "/s"));
        assert_eq!(address("rtsp://[fe80::1]/s"), is(554, "/s"));
        for wrong in ["", "http://a/s", "rtsp://a:99999/s", "rtsp://a/s t"] {
            assert_eq!(address(wrong), None, "{wrong}");
        }
        let two = body("<GetStreamUriResponse><Uri>rtsp://a/s</Uri></GetStreamUriResponse>");
        assert_eq!(parse_stream_address(&two), is(554, "/s"));
    }
}
