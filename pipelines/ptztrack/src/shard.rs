// SPDX-License-Identifier: MPL-2.0

use std::str::FromStr;

use crate::config::CameraSettings;

/// One process' share of the cameras: number so of so many, from 0.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Shard {
    number: u32,
    of: u32,
}

impl FromStr for Shard {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let parts =
            text.split_once('/').and_then(|(number, of)| Some((number.parse().ok()?, of.parse().ok()?)));
        match parts {
            Some((number, of)) if number < of => Ok(Self { number, of }),
            _ => Err("a share is NUMBER/OF, as 0/10 to 9/10".to_owned()),
        }
    }
}

impl Shard {
    /// Which one it is.
    pub fn number(self) -> u32 {
        self.number
    }

    /// How many there are.
    pub fn of(self) -> u32 {
        self.of
    }

    /// Whether a camera is in it. By the name alone, so that no other entry of the file changes it: while some processes have
    /// read a new file and others have not, none of them takes a camera that another has.
    pub fn has(self, camera: &CameraSettings) -> bool {
        fnv1a(camera.name.as_bytes()) % self.of == self.number
    }
}

/// The hash FNV-1a of 32 bits (Fowler, Noll, Vo): the same in every version and on every machine.
fn fnv1a(bytes: &[u8]) -> u32 {
    bytes.iter().fold(0x811c_9dc5, |hash, byte| (hash ^ u32::from(*byte)).wrapping_mul(0x0100_0193))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::Protocol;

    #[test]
    fn is_the_published_hash() {
        assert_eq!(fnv1a(b""), 0x811c_9dc5);
        assert_eq!(fnv1a(b"foobar"), 0xbf9c_f968);
    }

    #[test]
    fn every_camera_is_in_one_share() {
        for n in 0..200 {
            let camera = CameraSettings::at(&format!("camera-{n}"), Protocol::Vapix, "http://a").unwrap();
            let shares = (0..10).filter(|number| Shard { number: *number, of: 10 }.has(&camera));
            assert_eq!(shares.count(), 1);
        }
    }

    #[test]
    fn a_share_is_one_of_so_many() {
        assert_eq!("3/10".parse(), Ok(Shard { number: 3, of: 10 }));
        for wrong in ["10/10", "0/0", "3", "-1/3", "a/b"] {
            assert!(wrong.parse::<Shard>().is_err(), "{wrong}");
        }
    }
}
