// SPDX-License-Identifier: MPL-2.0

//! To be loaded before a program (`LD_PRELOAD`): in it, every pipeline leaves a graph in the folder that `GST_DEBUG_DUMP_DOT_DIR` names
//! whenever its state is to change, as `gst-launch-1.0` does: as it was built, and as it ran.

use glib::gobject_ffi::g_type_check_instance_is_a;
use gst::ffi::{
    GST_DEBUG_GRAPH_SHOW_VERBOSE, GstElement, GstState, GstStateChangeReturn,
    gst_debug_bin_to_dot_file_with_ts, gst_pipeline_get_type,
};

type SetState = unsafe extern "C" fn(*mut GstElement, GstState) -> GstStateChangeReturn;

/// Takes the place of GStreamer's.
///
/// # Safety
/// As that of GStreamer.
#[unsafe(no_mangle)]
unsafe extern "C" fn gst_element_set_state(
    element: *mut GstElement,
    state: GstState,
) -> GstStateChangeReturn {
    // SAFETY: it is an element, says GStreamer, and a bin where it is a pipeline; the next of this name is GStreamer's.
    unsafe {
        if g_type_check_instance_is_a(element.cast(), gst_pipeline_get_type()) != 0 {
            gst_debug_bin_to_dot_file_with_ts(
                element.cast(),
                GST_DEBUG_GRAPH_SHOW_VERBOSE,
                c"pipeline".as_ptr(),
            );
        }
        let next = libc::dlsym(libc::RTLD_NEXT, c"gst_element_set_state".as_ptr());
        let next: SetState = std::mem::transmute(next);
        next(element, state)
    }
}
