// sdf FILE: prints an SDF model as read by libsdformat, for .ci/export.py. One line for each link and joint; the library resolves the frames.
// Exit status 1 with the messages of the library if it finds an error.
#include <cstdio>
#include <iostream>
#include <sdf/sdf.hh>

static void put(const double x) { std::printf(" %.17g", x); }

template <class Pose> static void put_pose(const Pose &pose) {
    for (const double x : {pose.Pos().X(), pose.Pos().Y(), pose.Pos().Z(), pose.Rot().W(), pose.Rot().X(), pose.Rot().Y(), pose.Rot().Z()}) put(x);
}

static bool told(const sdf::Errors &errors) {
    for (const auto &error : errors) std::cerr << error << std::endl;
    return !errors.empty();
}

int main(int, char **arguments) {
    sdf::Root root;
    if (told(root.Load(arguments[1]))) return 1;
    const sdf::Model *model = root.Model();
    std::printf("model %s\n", model->Name().c_str());
    for (uint64_t k = 0; k < model->LinkCount(); k++) {
        const sdf::Link *link = model->LinkByIndex(k);
        const auto &inertial = link->Inertial();
        const auto moment = inertial.Moi();
        std::printf("link %s", link->Name().c_str());
        put(inertial.MassMatrix().Mass());
        put_pose(inertial.Pose());
        for (int row = 0; row < 3; row++)
            for (int column = 0; column < 3; column++) put(moment(row, column));
        std::printf("\n");
    }
    for (uint64_t k = 0; k < model->FrameCount(); k++) {
        const sdf::Frame *frame = model->FrameByIndex(k);
        auto pose = frame->RawPose();
        if (told(frame->SemanticPose().Resolve(pose, frame->AttachedTo()))) return 1;
        std::printf("frame %s %s", frame->Name().c_str(), frame->AttachedTo().c_str());
        put_pose(pose);
        std::printf("\n");
    }
    for (uint64_t k = 0; k < model->JointCount(); k++) {
        const sdf::Joint *joint = model->JointByIndex(k);
        const sdf::JointAxis *axis = joint->Axis();
        if (axis == nullptr) continue;
        // The child stands in the joint's frame at position zero.
        auto pose = joint->RawPose();
        auto direction = axis->Xyz();
        if (told(model->LinkByName(joint->ChildLinkName())->SemanticPose().Resolve(pose, joint->ParentLinkName()))) return 1;
        if (told(axis->ResolveXyz(direction, joint->ChildLinkName()))) return 1;
        std::printf("joint %s %s %s %s", joint->Name().c_str(), joint->Type() == sdf::JointType::PRISMATIC ? "slides" : "turns", joint->ParentLinkName().c_str(), joint->ChildLinkName().c_str());
        put_pose(pose);
        for (const double x : {direction.X(), direction.Y(), direction.Z(), axis->Lower(), axis->Upper(), axis->MaxVelocity(), axis->Effort(), axis->Damping(), axis->Friction()}) put(x);
        std::printf("\n");
    }
    return 0;
}
