// SPDX-License-Identifier: MPL-2.0

use ptztrack_contract::lock::lock;
use serde_json::{Value, json};

use crate::camera::Known;
use crate::config::Mqtt;
use crate::shard::Shard;

/// What the topic of availability says.
pub const ONLINE: &str = "online";
pub const OFFLINE: &str = "offline";

/// What is said, and where: `docs/program.md` lists it.
#[derive(Debug, Clone)]
pub struct Topics {
    own: String,
    /// Where Home Assistant looks for what there is.
    discovery: Option<String>,
    shard: Option<Shard>,
    /// There are pictures of who was followed.
    pictures: bool,
}

/// What Home Assistant is to show of a camera: component, field of the state, name, device class.
const ENTITIES: [(&str, &str, &str, Option<&str>); 3] = [
    ("binary_sensor", "following", "Follows somebody", Some("occupancy")),
    ("binary_sensor", "picture", "Picture", Some("connectivity")),
    ("sensor", "words", "State", None),
];

impl Topics {
    pub fn new(settings: &Mqtt, shard: Option<Shard>, pictures: bool) -> Self {
        Self { own: settings.topic.clone(), discovery: settings.discovery.clone(), shard, pictures }
    }

    /// Whether the program runs; each process that shares the cameras has its own.
    pub fn availability(&self) -> String {
        match self.shard {
            Some(shard) => format!("{}/availability/{}", self.own, shard.number()),
            None => format!("{}/availability", self.own),
        }
    }

    pub fn event(&self, camera: Option<&str>) -> String {
        match camera {
            Some(camera) => format!("{}/camera/{camera}/event", self.own),
            None => format!("{}/event", self.own),
        }
    }

    /// Of who was followed last.
    pub fn picture(&self, camera: &str) -> String {
        format!("{}/camera/{camera}/picture", self.own)
    }

    /// Of who is seen where, for those that share the cameras.
    pub fn tracks(&self, camera: &str) -> String {
        format!("{}/camera/{camera}/tracks", self.own)
    }

    /// The camera of such a topic.
    pub fn camera_of_tracks<'a>(&self, topic: &'a str) -> Option<&'a str> {
        topic.strip_prefix(&self.own)?.strip_prefix("/camera/")?.strip_suffix("/tracks")
    }

    fn state(&self, camera: &str) -> String {
        format!("{}/camera/{camera}/state", self.own)
    }

    /// Topics and payloads that the broker keeps of one camera.
    pub fn kept(&self, known: &Known) -> Vec<(String, String)> {
        let camera = known.name.as_str();
        let mut kept = vec![(self.state(camera), state(known).to_string())];
        if let Some(prefix) = &self.discovery {
            kept.extend(ENTITIES.map(|(component, field, name, class)| {
                let topic = format!("{prefix}/{component}/ptztrack_{camera}/{field}/config");
                (topic, self.entity(camera, field, name, class).to_string())
            }));
            if self.pictures {
                let topic = format!("{prefix}/image/ptztrack_{camera}/last/config");
                kept.push((topic, self.image(camera).to_string()));
            }
        }
        kept
    }

    /// One entity of Home Assistant (its documentation of MQTT discovery).
    fn entity(&self, camera: &str, field: &str, name: &str, class: Option<&str>) -> Value {
        let mut entity = self.of_camera(camera, field, name);
        entity["state_topic"] = self.state(camera).into();
        entity["value_template"] = format!("{{{{ value_json.{field} }}}}").into();
        if let Some(class) = class {
            entity["device_class"] = class.into();
        }
        entity
    }

    fn image(&self, camera: &str) -> Value {
        let mut entity = self.of_camera(camera, "last", "Last followed");
        entity["image_topic"] = self.picture(camera).into();
        entity["content_type"] = "image/jpeg".into();
        entity
    }

    fn of_camera(&self, camera: &str, field: &str, name: &str) -> Value {
        json!({
            "name": name,
            "unique_id": format!("ptztrack_{camera}_{field}"),
            "availability_topic": self.availability(),
            "device": { "identifiers": [format!("ptztrack_{camera}")], "name": camera, "manufacturer": "ptztrack" },
        })
    }
}

fn state(known: &Known) -> Value {
    let state = lock(&known.state).clone();
    let on = |yes| if yes { "ON" } else { "OFF" };
    let follows = state.picture && matches!(state.target.as_str(), "tracking" | "occluded");
    json!({
        "picture": on(state.picture),
        "following": on(follows),
        "target": state.target_id.filter(|_| follows),
        "words": known.in_words(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn topics(shard: Option<&str>) -> Topics {
        let discovery = Some("homeassistant".to_owned());
        let shard = shard.map(|shard| shard.parse().unwrap());
        Topics { own: "ptztrack".to_owned(), discovery, shard, pictures: true }
    }

    #[test]
    fn a_camera_has_a_state_and_what_home_assistant_asks_for() {
        let kept = topics(None).kept(&Known::new("door"));
        let names: Vec<&str> = kept.iter().map(|(topic, _)| topic.as_str()).collect();
        assert_eq!(
            names,
            [
                "ptztrack/camera/door/state",
                "homeassistant/binary_sensor/ptztrack_door/following/config",
                "homeassistant/binary_sensor/ptztrack_door/picture/config",
                "homeassistant/sensor/ptztrack_door/words/config",
                "homeassistant/image/ptztrack_door/last/config",
            ]
        );
        let image: Value = serde_json::from_str(&kept[4].1).unwrap();
        assert_eq!(image["image_topic"], "ptztrack/camera/door/picture");
        let none = Topics { pictures: false, ..topics(None) }.kept(&Known::new("door"));
        assert_eq!(none.len(), 4, "{none:?}");
        let state: Value = serde_json::from_str(&kept[0].1).unwrap();
        assert_eq!((&state["picture"], &state["target"]), (&json!("OFF"), &Value::Null));
        let entity: Value = serde_json::from_str(&kept[1].1).unwrap();
        assert_eq!(entity["value_template"], "{{ value_json.following }}");
        assert_eq!(entity["availability_topic"], "ptztrack/availability");
    }

    #[test]
    fn a_topic_of_tracks_tells_whose_they_are() {
        let topics = topics(Some("0/2"));
        assert_eq!(topics.camera_of_tracks(&topics.tracks("door")), Some("door"));
        assert_eq!(topics.camera_of_tracks("ptztrack/camera/door/state"), None);
    }

    #[test]
    fn processes_that_share_cameras_are_available_each_for_itself() {
        assert_eq!(topics(Some("3/10")).availability(), "ptztrack/availability/3");
    }
}
