//! Prediction and control: plain types in angles and seconds.
