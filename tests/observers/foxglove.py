"""Subscribes to all channels of a server of Foxglove by the package websockets, decodes the
messages by their schemas, and prints them after so many poses and a message of each channel of the
run.

usage: foxglove.py URL POSES
"""

import base64, hashlib, json, struct, sys
from mcap.records import Schema
from mcap_protobuf.decoder import DecoderFactory
from websockets.sync.client import connect
place = lambda pose: [pose.position.x, pose.position.y]
read = {
    '/pose': lambda m: place(m.pose), '/refined': lambda m: place(m.pose),
    '/tf': lambda m: [m.parent_frame_id, m.child_frame_id], '/trajectory': lambda m: [place(pose) for pose in m.poses],
    '/scan': lambda m: [m.encoding, m.width, m.height, hashlib.sha256(m.data).hexdigest()],
    '/masked': lambda m: [m.encoding, m.width, m.height, len(m.data)],
    '/points': lambda m: [m.point_stride, len(m.data), [field.name for field in m.fields]],
}
url, poses = sys.argv[1], int(sys.argv[2])
with connect(url, subprotocols=['foxglove.sdk.v1'], max_size=None) as socket:
    info, advertised = json.loads(socket.recv()), json.loads(socket.recv())
    assert (info['op'], info['capabilities'], advertised['op']) == ('serverInfo', ['time'], 'advertise'), info
    channels = {channel['id']: channel for channel in advertised['channels']}
    decoders = {}
    for id, channel in channels.items():
        if channel['encoding'] == 'protobuf':
            schema = Schema(id=id + 1, name=channel['schemaName'], encoding='protobuf', data=base64.b64decode(channel['schema']))
            decoders[id] = DecoderFactory().decoder_for('protobuf', schema)
        else:
            assert json.loads(channel['schema'])['type'] == 'object'
            decoders[id] = json.loads
    # Other numbers than the channels': they are distinguished.
    subscriptions = [{'id': id + 100, 'channelId': id} for id in channels]
    socket.send(json.dumps({'op': 'subscribe', 'subscriptions': subscriptions}))
    received = {channel['topic']: {} for channel in channels.values()}
    quiet = {'/log'}
    time = 0
    while len(received['/pose']) < poses or any(not received[topic] for topic in received.keys() - quiet):
        message = socket.recv()
        if isinstance(message, str):
            continue
        if message[0] == 2:
            assert struct.unpack('<Q', message[1:])[0] > time
            time, = struct.unpack('<Q', message[1:])
            continue
        kind, subscription, stamp = struct.unpack('<BIQ', message[:13])
        assert kind == 1 and stamp <= time, (kind, stamp, time)
        channel = channels[subscription - 100]
        decoded = decoders[channel['id']](message[13:])
        received[channel['topic']][stamp] = read.get(channel['topic'], lambda m: m if isinstance(m, dict) else None)(decoded)
print(json.dumps(received))
