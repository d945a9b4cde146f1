// SPDX-License-Identifier: MPL-2.0

use servo::Presets;

use session::Error;
use session::http::unexpected;

use crate::text::Fields;

/// Reads the answer to `query=presetposcam`, numbers and names of the presets of one channel: `presetposno1=Home` and
/// the like, below a title.
///
/// # Errors
/// [`Error::Unexpected`] where the answer is no list of presets; a list may be empty.
pub fn parse_presets(body: &str) -> Result<Presets, Error> {
    let presets: Vec<_> = Fields::of(body)
        .iter()
        .filter_map(|(key, name)| Some((key.strip_prefix("presetposno")?.parse().ok()?, name.to_owned())))
        .collect();
    if presets.is_empty() && !body.trim_start().starts_with("Preset") {
        return Err(unexpected(body));
    }
    Ok(Presets(presets))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_list_is_read() {
        let body = "Preset Positions for camera 1\r\npresetposno1=Home\r\npresetposno4=Gate, left\r\n\
                    presetposno4.data=tilt=0.000000:pan=0.000000:zoom=1.000000\r\n";
        let presets = parse_presets(body).unwrap();
        assert_eq!(presets.number("Gate, left"), Some(4));
        assert_eq!(presets.number("Home"), Some(1));
        assert_eq!(presets.number("gate"), None);
        assert_eq!(parse_presets("Preset Positions for camera 1\r\n"), Ok(Presets::default()));
        assert!(parse_presets("").is_err() && parse_presets("pan=1").is_err());
    }

    proptest! {
        #[test]
        fn any_text_is_read_or_refused(body in "(presetposno|[0-9]{1,12}|=|Home|\r\n|.){0,64}") {
            let _ = parse_presets(&body);
        }
    }
}
