"""Logs in with `onvif-zeep`, reads what the services have and steers with it."""

import os
import sys
import time

from onvif import ONVIFCamera


def wsdl():
    for folder, _, files in os.walk(sys.prefix):
        if "devicemgmt.wsdl" in files:
            return folder
    sys.exit("onvif-zeep has no WSDL")


def until(ptz, profile, condition):
    for _ in range(200):
        status = ptz.GetStatus({"ProfileToken": profile})
        if condition(status):
            return
        time.sleep(0.05)
    sys.exit(f"never came: {status}")


def main(address, user, password):
    host, port = address.split(":")
    camera = ONVIFCamera(host, int(port), user, password, wsdl())
    assert camera.devicemgmt.GetDeviceInformation().Manufacturer == "ptztrack"
    media, ptz = camera.create_media_service(), camera.create_ptz_service()
    profile = next(profile for profile in media.GetProfiles() if profile.PTZConfiguration)
    options = ptz.create_type("GetConfigurationOptions")
    options.ConfigurationToken = profile.PTZConfiguration.token
    assert ptz.GetConfigurationOptions(options).PTZTimeout.Min.total_seconds() == 1
    profile = profile.token
    names = [preset.Name for preset in ptz.GetPresets({"ProfileToken": profile})]
    assert names == ["Home"], names

    move = ptz.create_type("ContinuousMove")
    move.ProfileToken, move.Velocity = profile, {"PanTilt": {"x": 0.3, "y": 0}, "Zoom": {"x": 0}}
    ptz.ContinuousMove(move)
    until(ptz, profile, lambda status: status.MoveStatus.PanTilt == "MOVING")
    ptz.Stop({"ProfileToken": profile})
    until(ptz, profile, lambda status: status.MoveStatus.PanTilt == "IDLE")
    ptz.GotoPreset({"ProfileToken": profile, "PresetToken": "preset_1"})
    until(ptz, profile, lambda status: abs(status.Position.PanTilt.x) < 0.001 and status.MoveStatus.PanTilt == "IDLE")
    print("steered")


main(*sys.argv[1:])
