"""Trains the re-identification network on rendered pictures and writes it as ONNX.

python train_reid.py SCENES PORTRAITS VALIDATION OUT.onnx [--steps N]
"""

import argparse
import itertools
import math
import time

import torch
from torch.nn import functional as F

from pictures import Pictures
from portraits import portraits
from reid import HEIGHT, WIDTH, Export, ReId, triplet
from store import store

PEOPLE, EACH = 16, 4
# Every person is cut out so often, each time a little differently.
CUTS = 2
# Seen on less than this, pixels, or less of what the picture could show, nobody is told apart.
LEAST_AREA, LEAST_HEIGHT, LEAST_SHARE = 500, 50, 0.3


def cut(image, mask, box, random):
    """A crop as Hachi makes it: the box, black where the mask is not, stretched. The mask is as
    coarse and as wrong as a network's: cells of 8 pixels, noise, interpolated."""
    left, top, right, bottom = box
    jitter = 0.06 * (2 * torch.rand(4, generator=random) - 1)
    width, height = right - left, bottom - top
    left, right = left + int(jitter[0] * width), right + int(jitter[1] * width)
    top, bottom = top + int(jitter[2] * height), bottom + int(jitter[3] * height)
    left, top = max(left, 0), max(top, 0)
    image, mask = image[top:bottom, left:right], mask[top:bottom, left:right]
    rows, columns = mask.shape
    cells = F.adaptive_avg_pool2d(mask.float()[None, None], (max(rows // 8, 2), max(columns // 8, 2)))
    cells = cells + 0.15 * torch.randn(cells.shape, generator=random)
    inside = F.interpolate(cells, size=(rows, columns), mode="bilinear", align_corners=False)[0]
    inside = inside > 0.35 + 0.3 * torch.rand(1, generator=random)
    crop = (image.permute(2, 0, 1) * inside)[None].float()
    crop = F.interpolate(crop, size=(HEIGHT, WIDTH), mode="bilinear", align_corners=False, antialias=True)
    return crop[0].round().clamp(0, 255).to(torch.uint8)


def scenes(folder):
    """Identity, camera, picture, mask and box of everybody who can be told apart."""
    pictures = Pictures(folder)
    for seen in pictures.people:
        if seen.visible < LEAST_SHARE * seen.whole:
            continue
        mask = pictures.masks[seen.frame] == seen.label
        yield seen.id, seen.camera, pictures.image(seen.frame), mask, seen.box


def alone(folder):
    """The same of portraits, which have no camera."""
    for identity, image, mask in portraits(folder):
        rows, columns = mask.any(1).nonzero()[0], mask.any(0).nonzero()[0]
        if len(rows) > 0:
            yield identity, -1, image, mask, (columns[0], rows[0], columns[-1] + 1, rows[-1] + 1)


def load(people, cuts, random):
    """Crops [people seen, cuts, 3, rows, columns], identities, cameras."""
    crops, identities, cameras = [], [], []
    for identity, camera, image, mask, box in people:
        if mask.sum() < LEAST_AREA or box[3] - box[1] < LEAST_HEIGHT:
            continue
        image, mask = torch.from_numpy(image), torch.from_numpy(mask)
        crops.append(torch.stack([cut(image, mask, box, random) for _ in range(cuts)]))
        identities.append(identity)
        cameras.append(camera)
    return torch.stack(crops), torch.tensor(identities), torch.tensor(cameras)


def jittered(x, random):
    """Mirrored, in other light, with noise, partly hidden, partly out of the picture."""
    n = len(x)
    uniform = lambda low, high, *shape: low + (high - low) * torch.rand(*shape, generator=random)
    x = x.float() / 255
    flip = torch.rand(n, generator=random) < 0.5
    x[flip] = x[flip].flip(3)
    person = x.amax(1, keepdim=True) > 0
    # The renderings' own light differs: this is little more.
    gain = uniform(-0.15, 0.15, n, 1, 1, 1).exp() * uniform(0.95, 1.05, n, 3, 1, 1)
    x = x ** uniform(0.92, 1.08, n, 1, 1, 1) * gain
    x = (x + uniform(0, 0.02, n, 1, 1, 1) * torch.randn(x.shape, generator=random)).clamp(0, 1) * person
    for i in range(n):
        luck = torch.rand(6, generator=random).tolist()
        if luck[0] < 0.25:
            top, bottom = int(luck[1] * 0.4 * HEIGHT), int((1 - luck[2] * 0.4) * HEIGHT)
            x[i] = F.interpolate(x[i : i + 1, :, top:bottom], size=(HEIGHT, WIDTH), mode="bilinear")[0]
        if luck[3] < 0.3:
            left, rows = int(luck[4] * WIDTH), int(luck[5] * HEIGHT)
            x[i, :, rows : rows + HEIGHT // 3, max(left - 16, 0) : left + 16] = 0
    return x


@torch.no_grad()
def features(network, crops):
    network.eval()
    export = Export(network)
    found = torch.cat([export(crops[i : i + 64].float() / 255) for i in range(0, len(crops), 64)])
    network.train()
    return found


def ranking(found, identities, cameras):
    """Rank-1 and mAP: each picture among those of other cameras; and how far the same person and
    others are: the distance that refuses as many of the same as it takes of others, and their
    share; and how many of the same are refused where one in a hundred others is taken."""
    distances = 1 - found @ found.T
    same = identities[:, None] == identities[None]
    other_camera = cameras[:, None] != cameras[None]
    first, precision = [], []
    for d, s, use in zip(distances, same, other_camera):
        hits = s[use][d[use].argsort()].float()
        if hits.sum() == 0:
            continue
        first.append(hits[0])
        ranks = torch.nonzero(hits)[:, 0] + 1
        precision.append(((torch.arange(len(ranks)) + 1) / ranks).mean())
    upper = torch.ones_like(same).triu(1).bool()
    own, others = distances[same & upper].sort().values, distances[~same & upper].sort().values
    refused = lambda at: (own > at).float().mean().item()
    taken = (torch.arange(len(others)) + 1) / len(others)
    even = next(i for i in range(0, len(others), max(len(others) // 2000, 1)) if refused(others[i]) <= taken[i])
    strict = others[len(others) // 100].item()
    return {
        "rank-1": torch.stack(first).mean().item(),
        "mAP": torch.stack(precision).mean().item(),
        "even": (others[even].item(), taken[even].item()),
        "one in 100": (strict, refused(strict)),
    }


def main():
    parser = argparse.ArgumentParser()
    for name in ("scenes", "portraits", "validation", "out"):
        parser.add_argument(name)
    parser.add_argument("--steps", type=int, default=1800)
    arguments = parser.parse_args()
    torch.set_num_threads(1)
    torch.manual_seed(1)
    random = torch.Generator().manual_seed(2)
    train = itertools.chain(scenes(arguments.scenes), alone(arguments.portraits))
    crops, identities, _ = load(train, CUTS, random)
    validation = load(scenes(arguments.validation), 1, random)
    numbers = {identity: i for i, identity in enumerate(identities.unique().tolist())}
    identities = torch.tensor([numbers[i] for i in identities.tolist()])
    of = [torch.nonzero(identities == i)[:, 0] for i in range(len(numbers))]
    of = [pictures for pictures in of if len(pictures) >= 2]
    network = ReId(len(numbers))
    print(f"{len(crops)} crops of {len(of)} people", flush=True)
    optimiser = torch.optim.AdamW(network.parameters(), lr=2e-3, weight_decay=0.02)
    begun = time.monotonic()
    for step in range(1, arguments.steps + 1):
        some = []
        for person in torch.randperm(len(of), generator=random)[:PEOPLE].tolist():
            pictures = of[person]
            some.append(pictures[torch.randint(len(pictures), (EACH,), generator=random)])
        some = torch.cat(some)
        which = torch.randint(CUTS, (len(some),), generator=random)
        pooled, necked = network(jittered(crops[some, which], random))
        guess = network.identity(necked)
        identity_loss = F.cross_entropy(guess, identities[some], label_smoothing=0.1)
        triplet_loss = triplet(pooled, identities[some])
        rate = 2e-3 * min(1, step / 100) * (0.02 + 0.98 * (1 + math.cos(math.pi * step / arguments.steps)) / 2)
        for group in optimiser.param_groups:
            group["lr"] = rate
        optimiser.zero_grad()
        (identity_loss + triplet_loss).backward()
        optimiser.step()
        if step % 200 == 0:
            said = ranking(features(network, validation[0][:, 0]), *validation[1:])
            minutes = (time.monotonic() - begun) / 60
            print(f"{step} {minutes:.1f} min: {identity_loss:.3f} {triplet_loss:.3f} {said}", flush=True)
    print(f"{step} steps: {ranking(features(network, validation[0][:, 0]), *validation[1:])}")
    torch.save(network.state_dict(), arguments.out + ".pt")
    network.identity = torch.nn.Identity()
    store(Export(network), torch.zeros(2, 3, HEIGHT, WIDTH), arguments.out, "crops", ["features"], many=True)


main()
