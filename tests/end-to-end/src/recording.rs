// SPDX-License-Identifier: MPL-2.0

//! Recordings, looked at by an independent program.

use std::path::Path;
use std::process::Command;

/// How many pictures of 320x240 in H.264 a recording has, by `ffprobe`; all that it said where that is amiss.
///
/// # Errors
/// Where the recording is anything else, or not whole.
pub fn pictures_in(recording: &Path) -> Result<u32, String> {
    let probe = Command::new("timeout")
        .args(["120", "ffprobe", "-v", "error", "-count_frames"])
        .args(["-show_entries", "stream=codec_name,width,height,nb_read_frames", "-of", "csv=p=0"])
        .arg(recording)
        .output()
        .map_err(|err| err.to_string())?;
    let found = String::from_utf8_lossy(&probe.stdout);
    let pictures = found.trim().strip_prefix("h264,320,240,").and_then(|pictures| pictures.parse().ok());
    pictures.filter(|_| probe.stderr.is_empty()).ok_or_else(|| format!("{probe:?}"))
}
