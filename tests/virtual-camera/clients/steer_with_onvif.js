// Finds the camera with npm's `onvif`, logs in, reads what the services have and steers with it.

const { promisify } = require('util')
const { Cam, Discovery } = require('onvif')

const pause = (milliseconds) => new Promise((resolve) => setTimeout(resolve, milliseconds))

function check(condition, what) {
    if (!condition) throw new Error(JSON.stringify(what))
}

async function discovered(port) {
    const options = { timeout: 1000, resolve: false, device: 'lo' }
    const cameras = await promisify(Discovery.probe.bind(Discovery))(options)
    const addresses = cameras.map((camera) => camera.probeMatches.probeMatch.XAddrs)
    check(addresses.some((address) => address.includes(`:${port}/`)), `not among ${addresses}`)
}

async function main(address, username, password) {
    const [hostname, port] = address.split(':')
    await discovered(port)
    const cam = new Cam({ hostname, port: Number(port), username, password, autoconnect: false })
    const ask = (name, ...words) => promisify(cam[name].bind(cam))(...words)

    const drift = Math.abs((await ask('getSystemDateAndTime')) - Date.now())
    check(drift < 60_000, `its clock is ${drift} ms off`)
    await ask('getServices')
    check((await ask('getDeviceInformation')).manufacturer === 'ptztrack', 'another make')
    const profiles = await ask('getProfiles')
    const profile = profiles.find((profile) => profile.PTZConfiguration)
    const profileToken = profile.$.token
    check(profile.videoEncoderConfiguration.encoding === 'H264', profile.videoEncoderConfiguration)
    const { uri } = await ask('getStreamUri', { protocol: 'RTSP', profileToken })
    check(uri.startsWith(`rtsp://${hostname}:`), uri)
    const options = await ask('getConfigurationOptions', profile.PTZConfiguration.$.token)
    check(options.ptzTimeout.min[0] === 'PT1S', options.ptzTimeout)
    const presets = await ask('getPresets', { profileToken })
    check(presets.Home.$.token === 'preset_1', presets)

    const until = async (wanted) => {
        let status
        for (let look = 0; look < 200; look++) {
            status = await ask('getStatus', { profileToken })
            if (wanted(status)) return
            await pause(50)
        }
        throw new Error(`never came: ${JSON.stringify(status)}`)
    }
    const moves = (status) => status.moveStatus.panTilt === 'MOVING'
    await ask('continuousMove', { profileToken, x: 0.3, y: 0, zoom: 0, onlySendPanTilt: true })
    await until(moves)
    await ask('stop', { profileToken, panTilt: true, zoom: true })
    await until((status) => !moves(status))
    // Ends by itself.
    await ask('continuousMove', { profileToken, x: -0.3, y: 0, onlySendPanTilt: true, timeout: 1000 })
    await until(moves)
    await until((status) => !moves(status))
    await ask('gotoPreset', { profileToken, preset: 'preset_1' })
    await until((status) => Math.abs(status.position.x) < 0.001 && !moves(status))
    console.log('steered')
}

main(...process.argv.slice(2)).catch((error) => {
    console.error(error)
    process.exitCode = 1
}).finally(() => process.exit())
