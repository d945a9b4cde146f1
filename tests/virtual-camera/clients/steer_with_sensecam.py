"""Reads position and limits with `sensecam-control` and steers with it."""

import sys
import time

from sensecam_control.vapix_control import CameraControl


def until(camera, condition):
    for _ in range(200):
        pan, tilt, zoom = camera.get_ptz()
        if condition(pan, tilt, zoom):
            return
        time.sleep(0.05)
    sys.exit(f"never came: {pan} {tilt} {zoom}")


def main(address, user, password):
    camera = CameraControl(address, user, password)
    assert camera.get_ptz() == (0.0, 0.0, 1.0), camera.get_ptz()
    assert camera.get_speed() == 100
    assert camera.list_all_preset() == [(1, "Home")], camera.list_all_preset()
    assert "continuouspantiltmove" in camera.info_ptz_comands()
    # It has no word for the limits, but sends what it is given.
    text = camera._camera_command({"query": "limits"}).text
    limits = dict(line.split("=") for line in text.splitlines())
    left = float(limits["MinPan"])

    camera.absolute_move(left - 20, 1.5, 500, 80)
    until(camera, lambda pan, tilt, zoom: pan == left and tilt == 1.5 and zoom == 500)
    camera.continuous_move(40, 0, 0)
    until(camera, lambda pan, *_: pan > left + 2)
    camera.stop_move()
    camera.relative_move(1, -1, 0, 100)
    camera.go_home_position(100)
    until(camera, lambda *at: at == (0, 0, 1))
    print("steered")


main(*sys.argv[1:])
