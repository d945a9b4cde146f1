"""Reads position and limits with Kane610's `axis` (Home Assistant's library) and steers with it."""

import asyncio
import sys

from axis.device import AxisDevice
from axis.models.configuration import Configuration
from axis.models.ptz_cgi import PtzMove, PtzQuery
from httpx import AsyncClient


def values(text):
    """Numbers of a `key=value` answer."""
    pairs = (line.split("=", 1) for line in text.decode().splitlines() if "=" in line)
    return {key: value for key, value in pairs}


async def position(ptz):
    return values(await ptz.query(PtzQuery.POSITION))


async def until(ptz, condition):
    for _ in range(200):
        now = await position(ptz)
        if condition(float(now["pan"]), float(now["tilt"])):
            return now
        await asyncio.sleep(0.05)
    sys.exit(f"never came: {now}")


async def main(address, user, password):
    host, port = address.split(":")
    async with AsyncClient(trust_env=False) as session:
        device = AxisDevice(Configuration(session, host, port=int(port), username=user, password=password))
        ptz = device.vapix.ptz
        limits = values(await ptz.query(PtzQuery.LIMITS))
        right, up = float(limits["MaxPan"]), float(limits["MaxTilt"])
        parameters = (await ptz.get_ptz())["0"]
        assert float(parameters.limits["1"].max_pan) == right, parameters.limits
        assert parameters.support["1"].continuous_pan, parameters.support

        await ptz.control(pan=right + 50, tilt=up / 2)
        await until(ptz, lambda pan, tilt: pan == right and abs(tilt - up / 2) < 0.01)
        await ptz.control(continuous_pantilt_move=(-40, 0))
        await until(ptz, lambda pan, _: pan < right - 2)
        await ptz.control(continuous_pantilt_move=(0, 0))
        await ptz.control(move=PtzMove.HOME)
        await until(ptz, lambda pan, tilt: pan == 0 and tilt == 0)
        print("steered")


asyncio.run(main(*sys.argv[1:]))
