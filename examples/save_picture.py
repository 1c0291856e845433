"""Save one picture: events, moving objects, depth and motion at the end of the first second.

python examples/save_picture.py RECORDING [PICTURE] [SECONDS]
"""

import sys

import evimo
from evimo.events.events import joined
from evimo.viewing.panels import Panels
from evimo.viewing.picture import save_picture

path = sys.argv[1]
picture = sys.argv[2] if len(sys.argv) > 2 else "evimo.png"
seconds = float(sys.argv[3]) if len(sys.argv) > 3 else 1.0

recording = evimo.open_events(path)
panels = Panels(recording.sensor)
for estimate in evimo.run(recording, model="small", stop_s=seconds):  # every slice, for the curves of camera motion
    events = joined(list(recording.packets(estimate.start_us, estimate.stop_us)))
    image = panels.draw(estimate, events, time_origin_us=recording.start_us)
save_picture(image, picture)
print(picture)
