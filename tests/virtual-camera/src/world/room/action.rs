// SPDX-License-Identifier: MPL-2.0

//! What people do in the room, besides what the thesis' tests ask of one.

/// Who walks where. All but [`Self::Test`] and [`Self::Nobody`] begin as a test does: after two seconds or so the person to be
/// followed, number 1, comes in at the side of the first view.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Action {
    /// One person walks as in a test of the thesis.
    #[default]
    Test,
    /// Nobody is there, for ten minutes.
    Nobody,
    /// Two in different clothes come from opposite sides and pass each other.
    Cross,
    /// The same, both in the same clothes.
    CrossAlike,
    /// Two walk side by side; then one goes on and the other turns off.
    Part,
    /// One who walks faster comes from behind and overtakes.
    Overtake,
    /// Stops for some seconds, three times.
    StopAndGo,
    /// Sits down on a sofa for some seconds, rises and goes on.
    Sit,
    /// Walks straight at the camera, turns round and walks straight away from it.
    Approach,
    /// Runs at 4 m/s across the room and back.
    Run,
    /// Walks to and fro for three minutes, at changing speeds, with stops.
    Wander,
    /// Walks across the room in a group: [`super::RoomSettings::others`] walk with them.
    Group,
    /// Passes so close to the camera that they fill the picture.
    Near,
    /// Walks to and fro far away: out of doors only.
    Far,
    /// Nobody walks: number 1 is a car that drives along the street, stops and drives on. Out of doors only.
    Drive,
    /// Stands beside the first view and holds their hands into it for a while; then walks across the room.
    Reach,
    /// Walks to and fro for a minute and leaves; then somebody else comes in from the other side.
    Relay,
    /// Walks to and fro for three minutes; after the first of them somebody else comes in and does the same for a minute.
    Join,
}

impl Action {
    /// Every one, with its name for command lines and tables.
    pub const ALL: [(Self, &'static str); 18] = [
        (Self::Test, "test"),
        (Self::Nobody, "nobody"),
        (Self::Cross, "cross"),
        (Self::CrossAlike, "cross-alike"),
        (Self::Part, "part"),
        (Self::Overtake, "overtake"),
        (Self::StopAndGo, "stop-and-go"),
        (Self::Sit, "sit"),
        (Self::Approach, "approach"),
        (Self::Run, "run"),
        (Self::Wander, "wander"),
        (Self::Group, "group"),
        (Self::Near, "near"),
        (Self::Far, "far"),
        (Self::Drive, "drive"),
        (Self::Reach, "reach"),
        (Self::Relay, "relay"),
        (Self::Join, "join"),
    ];

    /// A number for streams of chance; the way of a thesis test has those of the tests.
    pub(super) fn way(self) -> u64 {
        100 + self as u64
    }
}
