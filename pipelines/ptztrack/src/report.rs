// SPDX-License-Identifier: MPL-2.0

//! Who was followed, as text: a table, JSON, CSV.

use events::Entry;
use serde_json::{Value, json};

/// For programs.
pub fn object(entry: &Entry) -> Value {
    let sighting = &entry.sighting;
    let step = |step: &events::Step| json!([utc(step.at_ms), step.pan_deg, step.tilt_deg]);
    json!({
        "id": entry.id,
        "camera": sighting.camera,
        "track": sighting.track,
        "from": utc(sighting.from_ms),
        "to": utc(sighting.to_ms),
        "way_deg": entry.way_deg,
        "path": sighting.path.iter().map(step).collect::<Vec<_>>(),
        "picture": entry.has_picture,
        "recording": sighting.recording.as_ref().map(|pointer| json!({
            "file": pointer.file,
            "offset_s": pointer.offset_ms as f64 / 1000.0,
        })),
    })
}

/// For spreadsheets (RFC 4180).
pub fn csv(entries: &[Entry]) -> String {
    let line = |entry: &Entry| {
        let sighting = &entry.sighting;
        let recording = sighting.recording.as_ref();
        let file =
            recording.map(|pointer| pointer.file.to_string_lossy().replace('"', "\"\"")).unwrap_or_default();
        let offset = recording.map(|pointer| seconds(pointer.offset_ms)).unwrap_or_default();
        format!(
            "{},{},{},{},{},{:.1},{},\"{file}\",{offset}\r\n",
            entry.id,
            sighting.camera,
            sighting.track,
            utc(sighting.from_ms),
            utc(sighting.to_ms),
            entry.way_deg,
            entry.has_picture,
        )
    };
    let head = "id,camera,track,from,to,way_deg,picture,recording,offset_s\r\n";
    head.to_owned() + &entries.iter().map(line).collect::<String>()
}

/// For people, in the time of where they are.
pub fn table(entries: &[Entry]) -> String {
    let line = |entry: &Entry| {
        let sighting = &entry.sighting;
        let recording = sighting.recording.as_ref();
        let recording = recording
            .map(|pointer| format!("{} at {} s", pointer.file.display(), seconds(pointer.offset_ms)))
            .unwrap_or_default();
        let line = format!(
            "{:>6}  {:<12}  {}  {:>8} s  {:>5.0}°  {:<7}  {recording}",
            entry.id,
            sighting.camera,
            local(sighting.from_ms),
            seconds(sighting.to_ms - sighting.from_ms),
            entry.way_deg,
            if entry.has_picture { "picture" } else { "" },
        );
        line.trim_end().to_owned() + "\n"
    };
    entries.iter().map(line).collect()
}

fn seconds(ms: i64) -> String {
    format!("{:.1}", ms as f64 / 1000.0)
}

fn utc(ms: i64) -> String {
    let text = glib::DateTime::from_unix_utc(ms / 1000).and_then(|time| time.format("%Y-%m-%dT%H:%M:%S"));
    text.map(|text| format!("{text}.{:03}Z", ms % 1000)).unwrap_or_default()
}

fn local(ms: i64) -> String {
    let text = glib::DateTime::from_unix_local(ms / 1000).and_then(|time| time.format("%Y-%m-%d %H:%M:%S"));
    text.map(String::from).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use events::{Pointer, Sighting, Step};

    use super::*;

    fn entry() -> Entry {
        let sighting = Sighting {
            camera: "door".to_owned(),
            run_ms: 0,
            track: 3,
            from_ms: 1_767_225_600_000,
            to_ms: 1_767_225_612_500,
            path: vec![Step { at_ms: 1_767_225_600_000, pan_deg: 1.5, tilt_deg: -2.0 }],
            picture: None,
            recording: Some(Pointer { file: "/r/a \"b\".mkv".into(), offset_ms: 750 }),
        };
        Entry { id: 7, sighting, way_deg: 12.34, has_picture: true, looks: None }
    }

    #[test]
    fn programs_get_all_of_it() {
        let object = object(&entry());
        assert_eq!(object["from"], "2026-01-01T00:00:00.000Z");
        assert_eq!(object["path"], json!([["2026-01-01T00:00:00.000Z", 1.5, -2.0]]));
        assert_eq!(object["recording"], json!({ "file": "/r/a \"b\".mkv", "offset_s": 0.75 }));
    }

    #[test]
    fn quotes_in_a_name_of_a_file_are_doubled() {
        let csv = csv(&[entry()]);
        let line = "7,door,3,2026-01-01T00:00:00.000Z,2026-01-01T00:00:12.500Z,12.3,true,\"/r/a \"\"b\"\".mkv\",0.8\r\n";
        assert_eq!(csv.split_once("\r\n").map(|(_, rest)| rest), Some(line), "{csv}");
    }

    #[test]
    fn people_get_a_line_each() {
        let table = table(&[entry(), entry()]);
        assert_eq!(table.lines().count(), 2);
        assert!(table.contains("12.5 s     12°  picture  /r/a \"b\".mkv at 0.8 s"), "{table}");
    }
}
