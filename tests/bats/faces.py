"""What tests of driven faces measure by: the 68 landmarks of the MESH records
that spid-dump --npy has put into mesh/, and the pixels of a video."""
import json
import subprocess

import numpy as np


def landmarks(path):
    """(T,68,2) pixels of 512 a side, by the head model at path."""
    raw = open(path, 'rb').read()
    n = int.from_bytes(raw[:8], 'little')
    entry = json.loads(raw[8:8 + n])

    def head(name, dtype):
        a, b = entry[name]['data_offsets']
        return np.frombuffer(raw[8 + n + a:8 + n + b], dtype).reshape(entry[name]['shape'])

    corners = head('f', '<i4')[head('landmark_faces', '<i4')]
    cam = np.load('mesh/MESH.cam.npy').reshape(-1, 1, 3, 4)
    verts = np.load('mesh/MESH.verts.npy')
    x = (verts.reshape(len(cam), -1, 3)[:, corners] *
         head('landmark_bary', '<f4')[:, :, None]).sum(2)
    x = (cam[..., :3] @ x[..., None])[..., 0] + cam[..., 3]
    return 256 * (12 * x[..., :2] / x[..., 2:] + 1)


def pictures(path, pix_fmt):
    """(T,512,512,C) bytes."""
    raw = subprocess.run(['ffmpeg', '-v', 'error', '-i', path, '-f', 'rawvideo',
                          '-pix_fmt', pix_fmt, '-'], capture_output=True, check=True).stdout
    return np.frombuffer(raw, 'u1').reshape(-1, 512, 512, 3 if pix_fmt == 'rgb24' else 1)
