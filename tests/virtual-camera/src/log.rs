// SPDX-License-Identifier: MPL-2.0

//! What happened, as CSV.

use std::{
    fs::File,
    io::{self, BufWriter, Write},
    path::Path,
};

use virtual_camera::{Status, VirtualCamera};

/// One line for each look at the camera, one more for each command since the last.
pub struct Log {
    file: BufWriter<File>,
    commands: u64,
}

impl Log {
    /// Begins the file with the names of its columns.
    pub fn create(path: &Path, camera: &VirtualCamera) -> io::Result<Self> {
        let mut file = BufWriter::new(File::create(path)?);
        writeln!(
            file,
            "time,pan_deg,tilt_deg,zoom_step,fov_deg,pan_rate_deg_s,tilt_rate_deg_s,moving,footage_frame,http_status,command"
        )?;
        let mut log = Self { file, commands: 0 };
        log.write(camera)?;
        Ok(log)
    }

    /// Adds the commands since the last time, and how the camera is now.
    pub fn write(&mut self, camera: &VirtualCamera) -> io::Result<()> {
        let status = camera.status();
        for command in camera.commands_after(self.commands) {
            self.commands = command.number;
            let query = command.query.replace('"', "\"\"");
            let time = command.time.as_secs_f64();
            self.line(time, &status, &command.status.to_string(), &format!("\"{query}\""))?;
        }
        self.line(status.time.as_secs_f64(), &status, "", "")?;
        // A reader may look while the camera runs.
        self.file.flush()
    }

    fn line(&mut self, time: f64, status: &Status, http_status: &str, command: &str) -> io::Result<()> {
        writeln!(
            self.file,
            "{time:.3},{:.4},{:.4},{:.0},{:.3},{:.3},{:.3},{},{},{http_status},{command}",
            status.pan_deg,
            status.tilt_deg,
            status.zoom_step,
            status.horizontal_fov_deg,
            status.pan_rate_deg_s,
            status.tilt_rate_deg_s,
            u8::from(status.moving),
            status.footage_frame,
        )
    }
}
