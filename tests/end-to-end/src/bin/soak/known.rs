// SPDX-License-Identifier: MPL-2.0

//! What stock GStreamer complains of although nothing is wrong.

/// A complaint that is known, and not ours.
#[derive(Debug, PartialEq)]
pub struct Known {
    /// Who complains, in GLib's words.
    domain: &'static str,
    /// The complaint itself.
    pub text: &'static str,
    /// Whose fault it is, and where one can read of it.
    pub why: &'static str,
}

/// Of a process that follows by RTSP.
///
/// Going from PAUSED to READY, the `rtspsrc` of GStreamer 1.22 forgets the sequence number that it gives every event, and only then
/// stops the thread that sends them (`gst_rtspsrc_change_state`, `gst_rtspsrc_stream_push_event`). A bare `rtspsrc ! fakesink`
/// that is taken up and down in a loop does it too. It is never one of ours: in Rust a sequence number cannot be the
/// invalid one, which is 0.
pub const OF_RTSPSRC: &[Known] = &[Known {
    domain: "GStreamer-CRITICAL",
    text: "gst_event_set_seqnum: assertion 'seqnum != GST_SEQNUM_INVALID' failed",
    why: "`rtspsrc` sends an event while it is taken to READY \
          ([gst1-java-core #172](https://github.com/gstreamer-java/gst1-java-core/issues/172))",
}];

impl Known {
    /// Whether the whole line is this complaint, as GLib writes it: `(program:4711): DOMAIN **: 12:00:00.000: text`.
    pub fn is(&self, line: &str) -> bool {
        let rest = line.strip_suffix(self.text).and_then(|rest| rest.strip_suffix(": "));
        let Some((program, time)) = rest.and_then(|rest| rest.split_once(&format!(": {} **: ", self.domain)))
        else {
            return false;
        };
        let is_program = program.starts_with('(') && program.ends_with(')');
        is_program && time.chars().all(|c| c.is_ascii_digit() || c == ':' || c == '.')
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LINE: &str = "(ptztrack:4711): GStreamer-CRITICAL **: 12:34:56.789: \
                        gst_event_set_seqnum: assertion 'seqnum != GST_SEQNUM_INVALID' failed";

    #[test]
    fn a_known_complaint_is_the_whole_line() {
        let known = &OF_RTSPSRC[0];
        assert!(known.is(LINE));
        for other in [
            format!("{LINE} and more"),
            format!("thread panicked: {LINE}"),
            LINE.replace("12:34:56.789", "panicked"),
            LINE.replace("GStreamer", "GLib"),
            LINE.replace("CRITICAL", "WARNING"),
            LINE.replace("seqnum != GST_SEQNUM_INVALID", "GST_IS_EVENT (event)"),
            known.text.to_owned(),
            String::new(),
        ] {
            assert!(!known.is(&other), "{other}");
        }
    }
}
