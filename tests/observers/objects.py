"""Prints the objects of a recording, as the package mcap decodes them by their schema: of each box
the time, the identity, the place and the length, and the number of arrows.

usage: objects.py RECORDING
"""

import json, sys
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory
boxes, arrows = [], 0
with open(sys.argv[1], 'rb') as file:
    for schema, channel, message, decoded in make_reader(file, decoder_factories=[DecoderFactory()]).iter_decoded_messages(
        topics=['/objects']
    ):
        assert schema.name == 'foxglove.SceneUpdate', schema.name
        entity, = decoded.entities
        assert (entity.frame_id, entity.id) == ('odometry', 'objects')
        arrows += len(entity.arrows)
        for cube, text in zip(entity.cubes, entity.texts, strict=True):
            place = cube.pose.position
            boxes.append([message.log_time, int(text.text), place.x, place.y, cube.size.x])
print(json.dumps({'boxes': boxes, 'arrows': arrows}))
