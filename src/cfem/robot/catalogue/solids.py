"""The solid of each body of the catalogue, by the type of its geometry."""

from cfem.robot.catalogue.bar import bar
from cfem.robot.catalogue.bellows import bellows
from cfem.robot.catalogue.diamond import diamond
from cfem.robot.catalogue.fin_ray import fin_ray
from cfem.robot.catalogue.pneunet import pneunet
from cfem.robot.catalogue.pneunet_trunk import pneunet_trunk
from cfem.robot.catalogue.soft_finger import soft_finger
from cfem.robot.catalogue.taper import taper
from cfem.robot.catalogue.trunk import trunk
from cfem.robot.catalogue.tube import tube
from cfem.robot.geometry import Bar, Bellows, Diamond, FinRay, PneuNet, PneuNetTrunk, SoftFinger, Taper, Trunk, Tube

CATALOGUE = {
    Bar: bar,
    Bellows: bellows,
    Diamond: diamond,
    FinRay: fin_ray,
    PneuNet: pneunet,
    PneuNetTrunk: pneunet_trunk,
    SoftFinger: soft_finger,
    Taper: taper,
    Trunk: trunk,
    Tube: tube,
}
