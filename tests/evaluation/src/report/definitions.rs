//! What is counted, in words, for those who read the figures.

/// One definition: what, and how it is counted.
pub const DEFINITIONS: &[(&str, &str)] = &[
    (
        "First box",
        "Counting begins with the first picture in which the person's whole box is inside the view, while the camera still \
         stands at home. No tracker has any influence on it, so all are counted over the same time; each is given the true \
         box of that picture, unless the first box is said to be detected. It ends with the end of the walk.",
    ),
    (
        "True positive, false positive",
        "TP: the tracker says that it tracks, and its centroid (mean of its features; middle of the box where it has none) \
         lies inside the true box of a person of whom at least 1 % is visible; the box goes round what is hidden too. FP: it says that it tracks, and that is not so. \
         A tracker that says it is searching, or that the target is occluded or lost, is neither right nor wrong.",
    ),
    ("P", "TP / (TP + FP) (thesis 5.1). None for a tracker that never tracks."),
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
    ("Acquired after", "From the first box to the first true positive."),
    (
        "Identity kept",
        "Whether, after every full occlusion, at least half of the frames are true positives in the second that begins one \
         second after the person came out. The share of the tests that have a full occlusion.",
    ),
    (
        "Switches",
        "How often the person under the tracked centroid became another one, of those that the ground truth knows. Where \
         boxes overlap it is the one to be followed, or else the one from before, or else the nearest; nobody is no switch.",
    ),
    (
        "Success, precision at 20 px",
        "Wu, Lim and Yang, Online object tracking: a benchmark (2013). Success: area under the curve that shows for each \
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
         of a second.",
    ),
    (
        "In real time",
        "Pictures that were dropped are missing from all counts. A picture is held to be the newest that the camera had when \
         it came.",
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
        "oracle knows the truth of the delayed picture, so what it loses is lost by servo and delay. still never moves the \
         camera; it is told the truth as well, so only its TF and d_gc say something.",
    ),
    (
        "The thesis' rows",
        "Means of the same tests as printed in its table 5.3: a real camera, room and people, which no simulation repeats.",
    ),
];
