// SPDX-License-Identifier: MPL-2.0

//! The text of `ptz.cgi?info=1`.

use crate::settings::Moves;

/// Commands with their arguments, as the camera lists them.
const COMMANDS: &[&str] = &[
    "{camera=[n]}",
    "whoami=yes",
    "center=[x],[y]",
    "  imagewidth=[n]",
    "  imageheight=[n]",
    "areazoom=[x],[y],[z]",
    "  imagewidth=[n]",
    "  imageheight=[n]",
    "move={ home | up | down | left | right | upleft | upright | downleft | downright | stop }",
    "pan=[absolute position]",
    "tilt=[absolute position]",
    "zoom=[n]",
    "focus=[n]",
    "iris=[n]",
    "brightness=[n]",
    "rpan=[offset]",
    "rtilt=[offset]",
    "rzoom=[n]",
    "rfocus=[n]",
    "riris=[n]",
    "rbrightness=[n]",
    "autofocus={ on | off }",
    "autoiris={ on | off }",
    "backlight={ on | off }",
    "ircutfilter={ on | off | auto }",
    "continuouspantiltmove=[x-speed],[y-speed]",
    "continuouszoommove=[speed]",
    "continuousfocusmove=[speed]",
    "continuousirismove=[speed]",
    "continuousbrightnessmove=[speed]",
    "speed=[n]",
    "gotoserverpresetname=[name]",
    "gotoserverpresetno=[n]",
    "gotodevicepreset=[n]",
    "query={ limits | mode | position | presetposall | presetposcam | presetposcamdata | speed | auxiliary }",
];

/// The list, with the colon on its own line as recorded from real cameras.
pub(super) fn commands(moves: &Moves) -> String {
    let mut taken = true;
    let listed = COMMANDS.iter().filter(|line| {
        // What is indented belongs to the line above.
        if !line.starts_with(' ') {
            taken = line.split_once('=').is_none_or(|(word, _)| moves.take(word));
        }
        taken
    });
    let lines: Vec<&str> = listed.copied().collect();
    format!("Available commands\r\n:\r\n{}\r\n", lines.join("\r\n"))
}
