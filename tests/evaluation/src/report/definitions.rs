// SPDX-License-Identifier: MPL-2.0

//! What is counted, in words, for those who read the figures.

/// One definition: what, and how it is counted.
pub const DEFINITIONS: &[(&str, &str)] = &[
    (
        "First box",
        "Counting begins with the first picture in which the person's whole box is inside the view, while the camera still \
         stands at home. No tracker has any influence on it, so all are counted over the same time. With the first box \
         detected, as users have it, those with a detector find the person themselves and all others are given the true box \
         of that picture; with the first box given all are. It ends with the end of the walk.",
    ),
    (
        "True positive, false positive",
        "TP: the tracker says that it tracks, and its centroid (mean of its features; middle of the box where it has none) \
         lies inside the whole silhouette, hidden parts included, of the person, of whom at least 1 % is visible. Where only a \
         box is known, in recordings, the box is the silhouette. FP: it says that it tracks, and that is not so. \
         A tracker that says it is searching, or that the target is occluded or lost, is neither right nor wrong.",
    ),
    ("P", "TP / (TP + FP) (thesis 5.1). None for a tracker that never tracks."),
    (
        "P with predictions",
        "Of the pictures for which the tracker gives a place, tracked or predicted while it says that the target is occluded, \
         the share in which that lies inside the whole silhouette, whether anything of it is visible or not.",
    ),
    (
        "DP",
        "CDF / nF (5.2): the share of true positives among the frames that contain the target, which are those in which at \
         least 10 % of the person is inside the view and hidden by nothing.",
    ),
    (
        "TF",
        "T_OUT / N_F (5.5): the share of all counted frames in which the middle of the person is outside of the picture.",
    ),
    (
        "d_gc",
        "Distance from the middle of the person to the middle of the picture, over the radius of the circle around the \
         picture (5.3). Mean and variance over the frames in which the middle of the person is inside the picture, hidden \
         or not.",
    ),
    (
        "d_gp",
        "Distance from the middle of the person to what is tracked, over the diameter of that circle (5.4). Mean and \
         variance over the same frames, as far as the tracker said that it was tracking.",
    ),
    (
        "Centred after, d_gc then",
        "From the first counted picture to the first from which on d_gc is below 0.1 for 0.5 s; mean of d_gc from there on. In \
         brackets how much more that is than the oracle's, over the runs in which both have it.",
    ),
    (
        "Loss",
        "The tracker holds the person when it says that it tracks or that the target is occluded, and its centroid lies inside \
         their silhouette or its box covers a tenth of that; also while it says occluded and less than a tenth of them is to be \
         seen. A loss is a time of more than 0.5 s, after the first true positive, in which it does not.",
    ),
    (
        "Causes of losses",
        "What is so first for more than 0.5 s from the beginning of the loss on, or else in most of its pictures. It says that it \
         tracks and: its box covers a tenth of somebody else or its centroid lies on them (went over to somebody else); less \
         than a tenth of the person is inside the view (out of view); its box moved by no more than a quarter of its width \
         against the background in the last 0.5 s (stuck on the background); or by more (went over to something else that \
         moves). It does not say so, and since the last true positive less than a tenth of the person was unhidden (hidden too \
         long), or inside the view (out of view), or neither (let go of someone in plain view). Never acquired: no true \
         positive in the whole run.",
    ),
    (
        "Intervals",
        "95 %, by the bootstrap: 2000 draws of groups with replacement. A group is all runs of the same seed and path, as \
         they are not independent of each other.",
    ),
    ("Seeds", "Each is another room, another person and other ways."),
    ("Acquired after", "From the first box to the first true positive."),
    (
        "Identity kept",
        "Whether, after every full occlusion, at least half of the frames are true positives in the second that begins one \
         second after the person came out. The share of the tests that have a full occlusion.",
    ),
    (
        "Switches",
        "How often the person under the tracked centroid became another one, of those that the ground truth knows. Where \
         silhouettes overlap it is the one to be followed, or else the one from before, or else the nearest; nobody is no switch.",
    ),
    (
        "IoU, precision at 20 px",
        "Wu, Lim and Yang, Online object tracking: a benchmark (2013). IoU, their success: area under the curve that shows for each \
         threshold from 0 to 1 the share of frames whose overlap (intersection over union) of tracked and true box is above \
         it, which is the mean overlap. Precision: the share of frames in which the middles of the two boxes are at most 20 \
         pixels of the picture apart. Both over the frames that contain the target; where nothing is tracked, there is no \
         overlap and nothing near.",
    ),
    (
        "Recordings",
        "In closed loop a camera turns within the recording, and the first view is the middle of it. As it is: raw, without \
         delays or commands, at the recording's size; d_gc and TF then only tell of the recording. Counting ends with the \
         person's last box; a person without a box in between is outside.",
    ),
    (
        "Servo",
        "The same for all, with its defaults; it is not told of the delays. Only for the thesis it predicts by the average \
         of a second. A tracker of OpenCV's that gives no box is held to say occluded for as long as ours would coast, and \
         lost from then on.",
    ),
    (
        "Read together",
        "P, DP and distances only count pictures with the person in them (or tracked): who loses the person early and says \
         so can have good ones. TF tells of the rest.",
    ),
    (
        "Means",
        "Every test counts the same. A test without a figure (no precision where nothing was ever tracked, no d_gp either) \
         is left out of that figure's mean.",
    ),
    (
        "Bounds",
        "oracle knows the truth of the delayed picture while anything of the person is to be seen. oracle-ego also tells the \
         servo how the background moves, as ours does, and coasts against it while the person is hidden. oracle-xray also sees \
         through what hides them: what it loses is lost by servo and delay. still never moves the camera; it is told the truth as well, so only its TF and d_gc say something.",
    ),
    (
        "The thesis' rows",
        "Means of the same tests as printed in its table 5.3: a real camera, room and people, which no simulation repeats.",
    ),
];
